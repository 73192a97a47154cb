import numpy as np
import pytest

from endoscope_bags import open_bag
from endoscope_core.trials.real_recordings import CYCLE_S
from endoscope_explain.benchmark.real_rig import (
    ARC,
    MODELS,
    PLANT,
    models_of_the_angle,
    observed,
    source_of,
    written_bags,
)

PLAY_DEG = 8.0


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Two cycles of a rig whose tip follows through play, five rows a stamp."""
    folder = tmp_path_factory.mktemp('real_rig')
    stamps = np.arange(0.0, 2.0 * CYCLE_S, 0.025)
    angle, rows = 0.0, []
    for t in stamps:
        command = 60.0 * np.sin(t)
        angle = min(max(angle, 0.5 * command - PLAY_DEG), 0.5 * command + PLAY_DEG)
        pulls = 5.0 + 0.05 * command, 5.0 - 0.05 * command
        row = f'{t:.6f}, {command:.6f}, 0.0, {angle:.6f}, {pulls[0]:.6f}, {pulls[1]:.6f}, 0.0, 0.0'
        rows += [row] * 5
    table = folder / '60.txt'
    table.write_text('\n'.join(rows))
    return written_bags(table, folder)


def test_the_first_cycle_is_a_bag_of_its_own(bags):
    first, whole = (open_bag(bag).joint_state('slave/measured_js') for bag in bags)
    assert first.stamp_ns[-1] * 1e-9 <= CYCLE_S < whole.stamp_ns[-1] * 1e-9
    assert whole.position[: len(first.position)].tolist() == first.position.tolist()


def test_the_command_is_the_shafts_and_the_angle_that_of_the_chord(bags):
    _, observation = observed(source_of(bags[1]))
    assert np.max(observation.inputs[0, :, 0]) == pytest.approx(
        np.radians(60.0) / PLANT.joints['bend_x'].gear, rel=1e-3
    )
    angle = next(c for c in observation.channels if c.quantity == 'bending')
    assert np.max(angle.value) == pytest.approx(ARC * np.radians(30.0 - PLAY_DEG), rel=1e-3)


def test_models_of_the_angle_follow_a_tip_behind_play(bags):
    _, observation = observed(source_of(bags[1]))
    left = models_of_the_angle(observation)
    assert set(left) == set(MODELS)
    assert np.degrees(left['prandtl_ishlinskii']) < 0.5
