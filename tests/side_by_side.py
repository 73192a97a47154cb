"""A plugin for pytest: which tests may run at the same time where several processes share them."""

import pytest

# Their programs miss real deadlines where other tests want the same two cores.
_IN_REAL_TIME = {
    'test_another_dds',
    'test_aurora_clients',
    'test_aurora_tracker',
    'test_calibration_on_a_line',
    'test_console',
    'test_console_browser_events',
    'test_console_hostile',
    'test_console_page',
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
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that run in real time."""
    for item in items:
        if item.path.stem in _IN_REAL_TIME:
            item.add_marker(pytest.mark.real_time)
