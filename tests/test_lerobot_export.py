"""`endoscope bag export --lerobot`: a data set that LeRobot's own reader reads as it was recorded.

LeRobot needs older libraries than the workspace, so that writer and reader run in the environment
that `make -C ros_ws lerobot` makes.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from short_bags import PLANT, write_short_bag

from endoscope_bags import open_bag
from endoscope_bags.episode import channels_of, episodes_of
from endoscope_bringup.cli import main
from endoscope_core.physics import save_plant

ENVIRONMENT = Path(__file__).parents[1] / 'ros_ws/.venv-lerobot/bin'
READER = """
import sys
import numpy as np
from lerobot.datasets import LeRobotDataset
folder, out = sys.argv[1:]
data = LeRobotDataset('endoscope/any', root=folder)
frames = [data[k] for k in range(len(data))]
columns = [key for key in frames[0] if key != 'task']
np.savez(out, **{key: np.stack([np.asarray(frame[key]) for frame in frames]) for key in columns})
print(data.fps, data.num_episodes, {frame['task'] for frame in frames})
"""


@pytest.fixture
def bag(tmp_path):
    return write_short_bag(tmp_path / 'run.mcap', PLANT)


def test_without_lerobot_it_is_refused_before_anything_is_written(
    bag, tmp_path, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, 'lerobot.datasets', None)
    assert main(['bag', 'export', str(bag), '--lerobot', str(tmp_path / 'set')]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert '`make -C ros_ws lerobot` makes .venv-lerobot' in line
    assert [path.name for path in tmp_path.iterdir()] == ['run.mcap']


@pytest.mark.nightly
def test_lerobot_reads_an_episode_as_it_was_recorded(bag, tmp_path):
    if not (ENVIRONMENT / 'python').exists():
        pytest.skip('LeRobot is not installed: make -C ros_ws lerobot')

    def run(*command):
        offline = {**os.environ, 'HF_HUB_OFFLINE': '1', 'HF_HOME': str(tmp_path / 'home')}
        done = subprocess.run(command, capture_output=True, text=True, env=offline, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    plant, folder = tmp_path / 'plant.yaml', tmp_path / 'set'
    save_plant(PLANT, plant)
    words = ['--lerobot', folder, '--plant', plant, '--task', 'sweep and step', '--json']
    printed = json.loads(run(ENVIRONMENT / 'endoscope', 'bag', 'export', bag, bag, *words))
    assert (printed['fps'], printed['episodes']) == (40, 2)
    assert set(printed['lacking']) == {'observation.meta.tip_force'}
    assert {delay['channel'] for delay in printed['delays'][0]} == {
        'motor/measured_js:motor_x',
        'slave/measured_js:bend_x',
        'wires/measured_js:wire_x_pos',
        'wires/measured_js:wire_x_neg',
    }
    shown = run(ENVIRONMENT / 'python', '-c', READER, folder, tmp_path / 'read.npz')
    assert shown == "40 2 {'sweep and step'}\n"
    [episode] = episodes_of(channels_of(open_bag(bag)), 40)
    with np.load(tmp_path / 'read.npz') as read:
        for feature, values in episode.values.items():
            assert np.array_equal(read[feature].reshape(2, *values.shape), [values, values])
        frames = np.arange(len(episode))
        assert np.array_equal(read['episode_index'], np.repeat([0, 1], len(episode)))
        assert read['timestamp'] == pytest.approx(np.tile(frames / 40.0, 2), abs=1e-6)
    card = (folder / 'README.md').read_text()
    assert '| run | slave/measured_js:bend_x | its stamp | 0.0' in card
