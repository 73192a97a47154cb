"""What a parameter offers is what the node has."""

from endoscope_core.choices import LOAD_CELL_DEVICES, SIMULATED
from endoscope_devices.load_cells import CONNECTIONS


def test_every_device_of_load_cells_has_its_connection() -> None:
    assert (SIMULATED, *CONNECTIONS) == LOAD_CELL_DEVICES
