"""Wire tensions from load cells behind a Modbus transmitter."""

from endoscope_devices.load_cells.calibration_file import load_calibration
from endoscope_devices.load_cells.modbus_load_cells import (
    CONNECTIONS,
    LoadCellDevice,
    modbus_rtu,
    modbus_tcp,
)
from endoscope_devices.load_cells.tare import TareError, apply_saved_tare, save_tare, tare_path

__all__ = [
    'CONNECTIONS',
    'LoadCellDevice',
    'TareError',
    'apply_saved_tare',
    'load_calibration',
    'modbus_rtu',
    'modbus_tcp',
    'save_tare',
    'tare_path',
]
