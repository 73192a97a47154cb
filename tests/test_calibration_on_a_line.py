"""The whole calibration in the running graph, with load cells read over a real line."""

import math
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from load_cell_rig import LATENCY, CellsOnWires, transmitter, write_calibration
from sensor_graph import NODES, SensorGraph
from tubes import tube_of_size

from endoscope_emulators.cables.serial_cable import SerialCable
from endoscope_nodes.names import CALIBRATION_RESULT
from endoscope_nodes.nodes.calibration import CalibrationNode
from endoscope_nodes.runtime.qos import RESULT

# What a calibration says where this machine lets the graph or the line wait for too long.
LONGEST_S = 600.0
STALLED = ('can be bridged', 'silent', 'the motion session has ended')


@pytest.fixture
def rtu(tmp_path):
    cells = CellsOnWires()
    with (
        SerialCable(tmp_path / 'ttyCells') as cable,
        transmitter(cells, serial_port=cable.device),
    ):
        yield 'modbus_rtu', str(cable.host), cells


@pytest.fixture
def tcp():
    cells = CellsOnWires()
    with transmitter(cells) as server:
        yield 'modbus_tcp', f'127.0.0.1:{server.tcp_port}', cells


@pytest.mark.parametrize(
    ('line', 'cell_rate', 'tick_rate', 'size_deg'),
    [('rtu', 200, 200, 50), ('tcp', 500, 250, 80)],
)
def test_a_calibration_ends_with_the_class_of_the_tube(
    tmp_path, request, line, cell_rate, tick_rate, size_deg
):
    device, port, cells = request.getfixturevalue(line)
    file = write_calibration(tmp_path, f'rate: {cell_rate}, latency: {LATENCY}')
    overrides = tube_of_size(tmp_path, size_deg, 900 + size_deg)
    overrides['load_cells'] = {'device': device, 'port': port, 'calibration_file': str(file)}
    overrides['calibration'] = {'motion': 'brief'}
    graph = SensorGraph(
        tmp_path / 'bag',
        cells=cells,
        nodes=(*NODES, CalibrationNode),
        tick_rate=tick_rate,
        **overrides,
    )
    with graph:
        results = []
        graph.probe.create_subscription(DiagnosticArray, CALIBRATION_RESULT, results.append, RESULT)
        graph.connect()
        values = calibrated(graph, results)
        assert values['class_deg'] == str(size_deg)
        assert math.degrees(float(values['regressed_size'])) == pytest.approx(size_deg, abs=5.0)


def calibrated(graph, results):
    """Values of a result; where this machine stalls, the rig is enabled and asked again."""
    deadline = time.monotonic() + LONGEST_S
    while time.monotonic() < deadline:
        graph.enable()
        known = len(results)
        answer = graph.call('calibration', 'run')
        if not answer.success:
            continue
        graph.wait(lambda known=known: len(results) > known)
        values = {v.key: v.value for v in results[-1].status[0].values}
        if not any(words in values.get('reason', '') for words in STALLED):
            assert results[-1].status[0].level == b'\x00', (values, graph.situation())
            return values
    return pytest.fail(f'this machine stalls all the time: {graph.situation()}')
