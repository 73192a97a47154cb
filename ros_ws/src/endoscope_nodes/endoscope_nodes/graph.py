"""All nodes of the endoscope composed in one process, in lock-step where all is simulated."""

import sys
import time
from functools import partial

from endoscope_core.errors import FileError
from endoscope_core.rig import load_rig
from endoscope_nodes.names import MOTOR_MEASURED
from endoscope_nodes.nodes.calibration import CalibrationNode
from endoscope_nodes.nodes.compensator import CompensatorNode
from endoscope_nodes.nodes.conductor import SelfStartingConductor
from endoscope_nodes.nodes.console import ConsoleNode
from endoscope_nodes.nodes.controller import ControllerNode
from endoscope_nodes.nodes.em_tracker import EmTrackerNode
from endoscope_nodes.nodes.instrument_model import InstrumentModelNode
from endoscope_nodes.nodes.load_cells import LoadCellsNode
from endoscope_nodes.nodes.motor_driver import MotorDriverNode
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.nodes.supervisor import SupervisorNode
from endoscope_nodes.program import CHECK, REAL_TIME, words_for_nobody
from endoscope_nodes.runtime.runtime import Runtime, run

# The motor driver beats first: the plant advances under the command of the tick before.
SLAVE_NODES = (MotorDriverNode, LoadCellsNode, EmTrackerNode, SupervisorNode)
CONTROL_NODES = (CompensatorNode, ControllerNode, CalibrationNode, ConsoleNode)
SHOWING_NODES = (InstrumentModelNode,)
ALL_NODES = (*SLAVE_NODES, *CONTROL_NODES, *SHOWING_NODES, RecorderNode)


_DEVICES = {'motor_driver': 'motors', 'load_cells': 'load_cells', 'em_tracker': 'tracker'}


def compose(runtime: Runtime, real_time: bool = False) -> None:
    """Add all nodes to an empty runtime, and in simulated time the conductor."""
    # In lock-step a busy machine makes the simulated slave slower, and nothing else.
    if not real_time and _is_simulated(runtime):
        runtime.keep_lock_step(
            {
                # Two runs never have the same stamps, nor sessions the same name.
                'start': float(int(time.time())),
                'speed': 1.0,
                # Load cells may fall silent.
                'wait_for': [MOTOR_MEASURED],
            }
        )
    for factory in ALL_NODES:
        runtime.add(factory)
    if runtime.ticker.simulated:
        runtime.add(SelfStartingConductor)


def _is_simulated(runtime: Runtime) -> bool:
    """Whether all devices are simulated and the command line leaves it open what time is."""
    given = {name: runtime.given(name) for name in _DEVICES}
    if any('use_sim_time' in values for values in given.values()):
        return False
    try:
        devices = load_rig(str(given['motor_driver'].get('rig_file') or '') or None).devices
    except FileError:
        # The first node says what is wrong with it.
        return False
    return all(
        (given[name].get('device') or getattr(devices, kind)) == 'simulated'
        for name, kind in _DEVICES.items()
    )


def main() -> int:
    """Run the whole graph in one process, or say which rate it could have here."""
    words = words_for_nobody(sys.argv[1:])
    if CHECK in words:
        from endoscope_nodes.carried_rate import check

        return check((*SLAVE_NODES, *CONTROL_NODES))
    return run(partial(compose, real_time=REAL_TIME in words))
