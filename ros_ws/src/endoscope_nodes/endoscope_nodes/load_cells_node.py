"""Reads the tension of the wires."""

from dataclasses import dataclass

from endoscope_core.plant import SensorModel
from endoscope_nodes.diagnostics import OK, STALE, Report
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.names import SIMULATED_WIRES, WIRES, WIRES_MEASURED
from endoscope_nodes.parameters import parameter
from endoscope_nodes.plant_parameter import load_plant_parameter
from endoscope_nodes.qos import LOCK_STEP, SENSOR_OFFERED
from endoscope_nodes.runtime import Runtime, run_nodes
from endoscope_nodes.sampling import SampleClock


@dataclass(frozen=True)
class LoadCellsParameters:
    """Parameters of the load cells."""

    device: str = parameter('simulated', 'what is read', choices=('simulated',))
    plant_file: str = parameter(
        '',
        'plant.yaml with the noise, resolution and rate of the simulated cells; empty for '
        'the nominal ones',
    )
    seed: int = parameter(2, 'seed of the simulated sensor noise', low=0)
    connected: bool = parameter(
        True,
        'false makes the simulated cells fall silent, as an unplugged cable does',
        dynamic=True,
    )


class LoadCellsNode(EndoscopeNode):
    """Publishes ``wires/measured_js``: the tension of four wires in N."""

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('load_cells', runtime)
        self._settings = self.parameters(LoadCellsParameters, self._on_parameters)
        p = self._settings
        sensors = load_plant_parameter('load_cells', p.plant_file).sensors
        self._sensors = SensorModel(sensors, p.seed)
        self._sampling = SampleClock(sensors.load_cell_rate)
        self._last_ns = 0
        self._measured = JointPublisher(self, WIRES_MEASURED, WIRES, ('effort',), SENSOR_OFFERED)
        JointSubscription(self, SIMULATED_WIRES, WIRES, self._on_wires, LOCK_STEP)
        self.diagnostics.add('cells', self._report, p.device)

    def _on_parameters(self, parameters: LoadCellsParameters) -> None:
        self._settings = parameters

    def _on_wires(self, sample: JointSample) -> None:
        if not self._sampling.due(sample.stamp_ns) or not self._settings.connected:
            return
        self._measured.publish(sample.stamp_ns, *self._sensors.tension(sample.effort).tolist())
        self._last_ns = self.ticker.monotonic_ns()

    def _report(self) -> Report:
        values = {'published': self._measured.count}
        age = self.ticker.monotonic_ns() - self._last_ns
        if self._measured.count == 0 or age > 500_000_000:
            return STALE, 'no readings', values
        return OK, 'reading', values


def main() -> int:
    """Run the load cells in a process of their own."""
    return run_nodes([LoadCellsNode])
