"""All nodes of the endoscope composed in one process, in lock-step where all is simulated.

With `--check` it runs them in real time, counts the commands that arrive, and says which rate this
machine carries.
"""

import os
import sys
import time
from functools import partial

from rclpy.context import Context
from rclpy.task import Future
from std_msgs.msg import String

from endoscope_core.errors import FileError
from endoscope_core.rig import load_rig
from endoscope_nodes.names import MASTER_NODE, MOTOR_MEASURED, OPERATING_STATE, STATE_COMMAND
from endoscope_nodes.nodes.calibration import CalibrationNode
from endoscope_nodes.nodes.compensator import CompensatorNode
from endoscope_nodes.nodes.controller import ControllerNode
from endoscope_nodes.nodes.em_tracker import EmTrackerNode
from endoscope_nodes.nodes.instrument_model import InstrumentModelNode
from endoscope_nodes.nodes.load_cells import LoadCellsNode
from endoscope_nodes.nodes.master import MasterNode
from endoscope_nodes.nodes.motor_driver import MotorDriverNode
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.nodes.simulation_clock import SelfStartingClock
from endoscope_nodes.nodes.supervisor import SupervisorNode
from endoscope_nodes.nodes.tip_force import TipForceNode
from endoscope_nodes.nodes.watch import WatchNode
from endoscope_nodes.program import CHECK, REAL_TIME, words_for_nobody
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.qos import EVENT, RESULT
from endoscope_nodes.runtime.runtime import Runtime, run

# The motor driver beats first: the plant advances under the command of the tick before.
SLAVE_NODES = (MotorDriverNode, LoadCellsNode, EmTrackerNode, SupervisorNode)
CONTROL_NODES = (CompensatorNode, ControllerNode, CalibrationNode, MasterNode)
SHOWING_NODES = (InstrumentModelNode, WatchNode, TipForceNode)
ALL_NODES = (*SLAVE_NODES, *CONTROL_NODES, *SHOWING_NODES, RecorderNode)


_DEVICES = {'motor_driver': 'motors', 'load_cells': 'load_cells', 'em_tracker': 'tracker'}
RATES = (1000, 500, 250)
CARRIED = 0.99
"""Share of the commands that have to reach the motors."""
_FOUND_S, _ENABLED_S, _COUNTED_S = 2.0, 1.5, 4.0


def compose(runtime: Runtime, real_time: bool = False) -> None:
    """Add all nodes to an empty runtime, and in simulated time the clock."""
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
        runtime.add(SelfStartingClock)


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


def check_rates() -> int:
    """Say which rate this machine carries, trying the simulated graph in real time; 1 if none."""
    for rate in RATES:
        share, trouble = _carried(rate)
        text = f'{100.0 * share:.1f} % of the commands reach the motors'
        print(f'{rate:>4} Hz: {text}{trouble and f": {trouble}"}', flush=True)
        if share >= CARRIED and not trouble:
            how = '' if rate == RATES[0] else f': graph --real-time --ros-args -p tick_rate:={rate}'
            print(f'this machine carries {rate} Hz in real time, as busy as it is now{how}')
            return 0
    print(
        f'this machine does not even carry {RATES[-1]} Hz in real time, as busy as it is now: end '
        'other programs, or give realtime_priority; a simulated slave needs no rate'
    )
    return 1


def _carried(rate: int) -> tuple[float, str]:
    """Share of the commands of a played motion that reach the motors, and what ended it."""
    arguments = ['--ros-args', '--log-level', 'fatal', '-r', f'__ns:=/check_{os.getpid()}']
    arguments += ['-p', 'use_sim_time:=false', '-p', f'tick_rate:={rate}']
    played = {MASTER_NODE: {'source': 'motion', 'motion': 'periodic'}}
    with Runtime(arguments, Context(), overrides=played) as runtime:
        for factory in (*SLAVE_NODES, *CONTROL_NODES):
            runtime.add(factory)
        asker = runtime.add(lambda runtime: EndoscopeNode('rate_check', runtime))
        states = ['']

        def note(message: String) -> None:
            states.append(message.data)

        asker.create_subscription(String, OPERATING_STATE, note, RESULT)
        orders = asker.create_publisher(String, STATE_COMMAND, EVENT)
        runtime.prepare(whole_process=True)
        runtime.spin_until(Future(), _FOUND_S)
        orders.publish(String(data='enable'))
        runtime.spin_until(Future(), _ENABLED_S)
        [driver] = [node for node in runtime.nodes if isinstance(node, MotorDriverNode)]
        gate = driver.motion.gate
        obeyed = gate.accepted
        runtime.spin_until(Future(), _COUNTED_S)
        share = (gate.accepted - obeyed) / (_COUNTED_S * rate)
        return min(1.0, share), '' if states[-1] == 'ENABLED' else states[-1] or 'nobody answers'


def main() -> int:
    """Run the whole graph in one process, or say which rate it could have here."""
    words = words_for_nobody(sys.argv[1:])
    if CHECK in words:
        return check_rates()
    return run(partial(compose, real_time=REAL_TIME in words))
