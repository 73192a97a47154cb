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
    ('overrides', 'words'),
    [
        ({'device': 'modbus_rtu'}, "'port' is empty"),
        ({'device': 'modbus_rtu', 'port': '/dev/null'}, "'calibration_file' is empty"),
        (
            {'device': 'modbus_tcp', 'port': 'h:x', 'calibration_file': 'CELLS'},
            "'h:x' is not an address",
        ),
        ({'device': 'modbus_rtu', 'port': 'p', 'calibration_file': 'nowhere'}, 'nowhere'),
        ({'device': 'modbus'}, 'did you mean modbus_'),
    ],
)
def test_parameters_of_real_cells_are_checked(tmp_path, overrides, words):
    if overrides.get('calibration_file') == 'CELLS':
        overrides = overrides | {'calibration_file': str(write_calibration(tmp_path))}
    with pytest.raises(ParameterError, match=words):
        start(['--ros-args', '--log-level', 'fatal'], LoadCellsNode, overrides)


@pytest.mark.parametrize(
    ('overrides', 'words'),
    [
        ({'device': 'aurora'}, "'port' is empty"),
        ({'device': 'aurora', 'port': 'p', 'registration_file': 'BAD'}, 'orientation is missing'),
        ({'device': 'polaris'}, 'aurora'),
    ],
)
def test_parameters_of_a_real_tracker_are_checked(tmp_path, overrides, words):
    if 'registration_file' in overrides:
        (tmp_path / 'bad.yaml').write_text('position: [0, 0, 0]')
        overrides = overrides | {'registration_file': str(tmp_path / 'bad.yaml')}
    with pytest.raises(ParameterError, match=words):
        start(['--ros-args', '--log-level', 'fatal'], EmTrackerNode, overrides)


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
