import numpy as np
import pytest

from endoscope_core.errors import FileError
from endoscope_core.signals.sampled_motion import read_command_file, write_command_file


def test_what_is_written_is_read_back(tmp_path):
    time = 0.001 * np.arange(500)
    angle = np.stack([0.5 * np.sin(time), -0.2 * time], axis=1)
    write_command_file(tmp_path / 'motion.csv', time, angle)
    table = read_command_file(tmp_path / 'motion.csv')
    assert table.joints == ('bend_x', 'bend_y')
    assert table.time == pytest.approx(time, abs=1e-4)
    assert table.angle == pytest.approx(angle, abs=1e-6)


def test_columns_may_come_in_another_order(tmp_path):
    path = tmp_path / 'motion.csv'
    path.write_text('bend_y,time,bend_x\n1,0,2\n3,1,4\n')
    assert read_command_file(path).angle.tolist() == [[2, 1], [4, 3]]


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('time,bend_x\n0,0\n1,0\n', 'no column bend_y'),
        ('time,bend_x,bend_y\n0,0,0\n', 'fewer than two rows'),
        ('time,bend_x,bend_y\n0,0,0\n1,x,0\n', 'line 3 holds something else'),
        ('time,bend_x,bend_y\n0,0,0\n1,0\n', 'line 3 holds something else'),
        ('time,bend_x,bend_y\n0,0,0\n1,nan,0\n', 'line 3 holds a value that is not finite'),
        ('time,bend_x,bend_y\n0,0,0\n2,0,0\n1,0,0\n', 'time does not increase at line 4'),
    ],
)
def test_an_unusable_file_is_refused_with_its_line(tmp_path, text, message):
    path = tmp_path / 'motion.csv'
    path.write_text(text)
    with pytest.raises(FileError, match=message):
        read_command_file(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileError, match='cannot be read'):
        read_command_file(tmp_path / 'absent.csv')


def test_nothing_is_written_of_a_motion_that_is_not_finite(tmp_path):
    with pytest.raises(FileError, match='not finite'):
        write_command_file(tmp_path / 'motion.csv', [0.0, 1.0], [[0.0, 0.0], [np.nan, 0.0]])
    assert list(tmp_path.iterdir()) == []
