"""A plugin for pytest: which tests may run at the same time where several processes share them."""

import pytest

# Their programs miss real deadlines where a second graph wants the same two cores.
_IN_REAL_TIME = {
    'test_aurora_clients',
    'test_aurora_tracker',
    'test_calibration_on_a_line',
    'test_dynamixel_line_faults',
    'test_faults',
    'test_graph_real_time',
    'test_load_cells_on_modbus',
    'test_motor_faults',
    'test_node_processes',
    'test_real_time',
    'test_recorder',
    'test_recorder_process',
    'test_replay',
    'test_sensor_faults',
    'test_teleop',
}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the tests of a file in one process, and all that run in real time in the same one."""
    if not config.pluginmanager.hasplugin('xdist'):
        return
    for item in items:
        alone = item.path.stem in _IN_REAL_TIME
        group = 'in real time' if alone else str(item.path)
        item.add_marker(pytest.mark.xdist_group(group))
