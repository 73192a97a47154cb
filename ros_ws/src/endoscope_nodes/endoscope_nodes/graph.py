"""All nodes of the endoscope composed in one process."""

from endoscope_nodes.calibration_node import CalibrationNode
from endoscope_nodes.compensator_node import CompensatorNode
from endoscope_nodes.conductor_node import SelfStartingConductor
from endoscope_nodes.console_node import ConsoleNode
from endoscope_nodes.controller_node import ControllerNode
from endoscope_nodes.em_tracker_node import EmTrackerNode
from endoscope_nodes.instrument_model_node import InstrumentModelNode
from endoscope_nodes.load_cells_node import LoadCellsNode
from endoscope_nodes.motor_driver_node import MotorDriverNode
from endoscope_nodes.recorder_node import RecorderNode
from endoscope_nodes.runtime import Runtime, run
from endoscope_nodes.supervisor_node import SupervisorNode

# The motor driver beats first: the plant advances under the command of the tick before.
SLAVE_NODES = (MotorDriverNode, LoadCellsNode, EmTrackerNode, SupervisorNode)
CONTROL_NODES = (CompensatorNode, ControllerNode, CalibrationNode, ConsoleNode)
SHOWING_NODES = (InstrumentModelNode,)
ALL_NODES = (*SLAVE_NODES, *CONTROL_NODES, *SHOWING_NODES, RecorderNode)


def compose(runtime: Runtime) -> None:
    """Add all nodes, and in simulated time the conductor."""
    for factory in ALL_NODES:
        runtime.add(factory)
    if runtime.ticker.simulated:
        runtime.add(SelfStartingConductor)


def main() -> int:
    """Run the whole graph in one process."""
    return run(compose)
