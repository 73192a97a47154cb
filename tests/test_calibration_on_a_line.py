"""The whole calibration in the running graph, with load cells read over a real line."""

import math
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from load_cell_rig import LATENCY, CellsOnWires, transmitter, write_calibration
from sensor_graph import NODES, SensorGraph
from tubes import tube_of_size

from endoscope_nodes.names import CALIBRATION_RESULT
from endoscope_nodes.nodes.calibration import CalibrationNode
from endoscope_nodes.runtime.qos import RESULT

pytestmark = pytest.mark.nightly

CELL_RATE, TICK_RATE = 500, 250
SIZE_DEG = 80
LONGEST_S = 600.0
# What a calibration says where this machine lets the graph or the line wait for too long.
STALLED = ('can be bridged', 'silent', 'the motion session has ended')


def test_a_calibration_ends_with_the_class_of_the_tube(tmp_path):
    cells = CellsOnWires()
    file = write_calibration(tmp_path, f'rate: {CELL_RATE}, latency: {LATENCY}')
    overrides = tube_of_size(tmp_path, SIZE_DEG, 900 + SIZE_DEG)
    overrides['calibration'] = {'motion': 'brief'}
    with transmitter(cells) as server:
        overrides['load_cells'] = {
            'device': 'modbus_tcp',
            'port': f'127.0.0.1:{server.tcp_port}',
            'calibration_file': str(file),
        }
        graph = SensorGraph(
            tmp_path / 'bag',
            cells=cells,
            nodes=(*NODES, CalibrationNode),
            tick_rate=TICK_RATE,
            **overrides,
        )
        with graph:
            values = calibrated(graph)
    assert values['class_deg'] == str(SIZE_DEG)
    assert math.degrees(float(values['regressed_size'])) == pytest.approx(SIZE_DEG, abs=5.0)


def calibrated(graph):
    """Values of a result; where this machine stalls, the rig is enabled and asked again."""
    results = []
    graph.probe.create_subscription(DiagnosticArray, CALIBRATION_RESULT, results.append, RESULT)
    graph.connect()
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
