"""What a parameter offers is what the node has."""

from endoscope_core.choices import FEEDBACK_LAWS, LOAD_CELL_DEVICES, SIMULATED
from endoscope_devices.load_cells import CONNECTIONS
from endoscope_nodes.nodes.controller import LAWS


def test_every_law_of_feedback_has_its_controller() -> None:
    assert tuple(LAWS) == FEEDBACK_LAWS


def test_every_device_of_load_cells_has_its_connection() -> None:
    assert (SIMULATED, *CONNECTIONS) == LOAD_CELL_DEVICES
