"""Parameters of real load cells and of a real tracker."""

import pytest
from load_cell_rig import write_calibration
from rclpy.context import Context

from endoscope_nodes.nodes.em_tracker import EmTrackerNode
from endoscope_nodes.nodes.load_cells import LoadCellsNode
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.runtime import Runtime


@pytest.mark.parametrize(
    ('factory', 'overrides', 'words'),
    [
        (LoadCellsNode, {'device': 'modbus_rtu'}, "'port' is empty"),
        (LoadCellsNode, {'device': 'modbus_rtu', 'port': 'p'}, "'calibration_file' is empty"),
        (
            LoadCellsNode,
            {'device': 'modbus_tcp', 'port': 'h:x', 'calibration_file': 'cells.yaml'},
            "'h:x' is not an address",
        ),
        (
            LoadCellsNode,
            {'device': 'modbus_rtu', 'port': 'p', 'calibration_file': 'nowhere'},
            'nowhere',
        ),
        (LoadCellsNode, {'device': 'modbus'}, 'did you mean modbus_'),
        (EmTrackerNode, {'device': 'aurora'}, "'port' is empty"),
        (
            EmTrackerNode,
            {'device': 'aurora', 'port': 'p', 'registration_file': 'bad.yaml'},
            'orientation is missing',
        ),
        (EmTrackerNode, {'device': 'polaris'}, 'aurora'),
    ],
)
def test_parameters_of_real_sensors_are_checked(tmp_path, monkeypatch, factory, overrides, words):
    monkeypatch.chdir(tmp_path)
    write_calibration(tmp_path)
    (tmp_path / 'bad.yaml').write_text('position: [0, 0, 0]')
    with pytest.raises(ParameterError, match=words):
        start(['--ros-args', '--log-level', 'fatal'], factory, overrides)


@pytest.mark.parametrize(
    ('factory', 'device'), [(LoadCellsNode, 'modbus_tcp'), (EmTrackerNode, 'aurora')]
)
def test_real_devices_need_real_time(factory, device):
    with pytest.raises(ParameterError, match='needs real time'):
        start(['--ros-args', '-p', 'use_sim_time:=true'], factory, {'device': device})


def start(arguments, factory, overrides):
    name = 'load_cells' if factory is LoadCellsNode else 'em_tracker'
    with Runtime(arguments, Context(), private_domain(), {name: overrides}) as runtime:
        runtime.add(factory)
