"""The whole calibration in the running graph, with load cells read over a real line."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from load_cell_rig import LATENCY, CellsOnWires, transmitter, write_calibration
from sensor_graph import NODES, SensorGraph
from tubes import tube_of_size

from endoscope_devices.emulation.serial_cable import SerialCable
from endoscope_nodes.calibration_node import CalibrationNode
from endoscope_nodes.names import CALIBRATION_RESULT
from endoscope_nodes.qos import RESULT


@pytest.fixture(params=['modbus_rtu', 'modbus_tcp'])
def line(request, tmp_path):
    """Device parameters of load cells, and the cells at the line's other end."""
    cells = CellsOnWires()
    if request.param == 'modbus_tcp':
        with transmitter(cells) as server:
            yield request.param, f'127.0.0.1:{server.tcp_port}', cells
        return
    with (
        SerialCable(tmp_path / 'ttyCells') as cable,
        transmitter(cells, serial_port=cable.device),
    ):
        yield request.param, str(cable.host), cells


@pytest.mark.parametrize(
    ('cell_rate', 'tick_rate', 'motion', 'size_deg'),
    [(200, 200, 'sinusoid', 50), (200, 500, 'brief', 80), (1000, 500, 'brief', 60)],
)
def test_a_calibration_ends_with_the_class_of_the_tube(
    tmp_path, line, cell_rate, tick_rate, motion, size_deg
):
    device, port, cells = line
    file = write_calibration(tmp_path, f'rate: {cell_rate}, latency: {LATENCY}')
    overrides = tube_of_size(tmp_path, size_deg, 900 + size_deg)
    overrides['load_cells'] = {'device': device, 'port': port, 'calibration_file': str(file)}
    graph = SensorGraph(
        tmp_path / 'bag',
        cells=cells,
        nodes=(*NODES, CalibrationNode),
        tick_rate=tick_rate,
        calibration={'motion': motion},
        **overrides,
    )
    with graph:
        results = []
        graph.probe.create_subscription(DiagnosticArray, CALIBRATION_RESULT, results.append, RESULT)
        graph.connect()
        graph.enable()
        values = calibrated(graph, results)
        assert values['class_deg'] == str(size_deg)
        assert math.degrees(float(values['regressed_size'])) == pytest.approx(size_deg, abs=5.0)


def calibrated(graph, results):
    """Values of a result; where this machine stalls over a gap, it is asked again as on a rig."""
    for _ in range(5):
        known = len(results)
        answer = graph.call('calibration', 'run')
        assert answer.success, answer.message
        graph.wait(lambda known=known: len(results) > known)
        values = {v.key: v.value for v in results[-1].status[0].values}
        if 'can be bridged' not in values.get('reason', ''):
            break
    assert results[-1].status[0].level == b'\x00', values
    return values
