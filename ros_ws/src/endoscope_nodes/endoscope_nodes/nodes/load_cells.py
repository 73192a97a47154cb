"""Reads the tension of the wires."""

from endoscope_core.errors import FileError
from endoscope_core.physics import SensorModel
from endoscope_devices.device import DeviceError
from endoscope_devices.load_cells import (
    CONNECTIONS,
    LoadCellDevice,
    TareError,
    apply_saved_tare,
    load_calibration,
    save_tare,
    tare_path,
)
from endoscope_nodes import names
from endoscope_nodes.runtime.diagnostics import ERROR, OK, STALE, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import LoadCellsParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import LOCK_STEP, SENSOR_ASKED, SENSOR_OFFERED
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.runtime.ticker import SampleClock


class LoadCellsNode(EndoscopeNode):
    """Publishes ``wires/measured_js``: the tension of four wires in N, none where one is faulty.

    ``~/tare`` takes the tension of the last second for zero, and keeps it.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('load_cells', context)
        self._settings = self.parameters(LoadCellsParameters, self._on_parameters)
        p = self._settings
        self._last_ns = 0
        self._reported = ''
        self._cells: LoadCellDevice | None = None
        self._measured = JointPublisher(
            self, names.WIRES_MEASURED, names.WIRES, ('effort',), SENSOR_OFFERED
        )
        device = self._device_name = p.device or self.rig.devices.load_cells
        if device == 'simulated':
            sensors = context.plant.sensors
            self._sensors = SensorModel(sensors, context.seed_of(1))
            self._sampling = SampleClock(sensors.load_cell_rate)
            JointSubscription(self, names.SIMULATED_WIRES, names.WIRES, self._on_wires, LOCK_STEP)
        else:
            self._cells = self._connect(device, p)
            JointSubscription(
                self, names.MOTOR_MEASURED, names.MOTORS, self._on_shafts, SENSOR_ASKED
            )
            self.ticker.add(self._on_tick)
        self.serve('~/tare', self._tare)
        self.diagnostics.add('cells', self._report, device)

    def _on_parameters(self, parameters: LoadCellsParameters) -> None:
        self._settings = parameters

    @property
    def announcement(self) -> str:
        """Name the device."""
        return f'load cells {self._device_name}'

    def _connect(self, device: str, p: LoadCellsParameters) -> LoadCellDevice:
        self.require_real_time(device)
        for name, value in (('port', p.port), ('calibration_file', p.calibration_file)):
            if not value:
                raise ParameterError(f"load_cells: parameter '{name}' is empty: {device} needs it")
        try:
            calibration = apply_saved_tare(
                tare_path(p.calibration_file), load_calibration(p.calibration_file, names.WIRES)
            )
            cells = CONNECTIONS[device](p.port, calibration)
        except FileError as error:
            raise ParameterError(f"load_cells: parameter 'calibration_file': {error}") from error
        except DeviceError as error:
            raise ParameterError(f"load_cells: parameter 'port': {error}") from error
        cells.open()
        return cells

    def _on_wires(self, sample: JointSample) -> None:
        if not self._sampling.due(sample.stamp_ns) or not self._settings.connected:
            return
        self._publish(sample.stamp_ns, tuple(self._sensors.tension(sample.effort).tolist()))

    def _on_tick(self, _stamp_ns: int, _periods: int) -> None:
        if self._cells is None:
            return
        to_stamp_ns = self.ticker.now_ns() - self.ticker.monotonic_ns()
        for reading in self._cells.take():
            self._publish(reading.time_ns + to_stamp_ns, reading.tension)
        trouble = self._cells.trouble
        if bool(trouble) != bool(self._reported):
            self._reported = trouble
            self.diagnostics.publish()

    def _publish(self, stamp_ns: int, tension: tuple[float, ...]) -> None:
        self._measured.publish(stamp_ns, *tension)
        self._last_ns = self.ticker.monotonic_ns()

    def _on_shafts(self, sample: JointSample) -> None:
        if self._cells is not None:
            self._cells.note_shafts(sample.velocity)

    def _tare(self) -> tuple[bool, str]:
        if self._cells is None:
            return False, 'simulated cells have no zero to find'
        try:
            tared = self._cells.tared()
            save_tare(tare_path(self._settings.calibration_file), tared)
        except (TareError, OSError) as error:
            self.get_logger().warning(f'not tared: {error}')
            return False, f'not tared: {error}'
        self._cells.use(tared)
        zeros = ', '.join(f'{name} {cell.zero:.6g} counts' for name, cell in tared.wires.items())
        self.get_logger().info(f'zero: {zeros}')
        return True, f'zero: {zeros}'

    def _report(self) -> Report:
        values: dict[str, object] = {'published': self._measured.count}
        if self._cells is not None:
            trouble, figures = self._cells.health()
            values |= figures
            if trouble:
                return ERROR, trouble, values
        age = self.ticker.monotonic_ns() - self._last_ns
        if self._measured.count == 0 or age > 500_000_000:
            return STALE, 'no readings', values
        return OK, 'reading', values

    def close(self) -> None:
        """Let go of the transmitter."""
        if self._cells is not None:
            self._cells.close()
