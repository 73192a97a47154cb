"""The force at the tip: what the plant's own simulation exerts is found again."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from endoscope_core.kinematics import tip_lever, tip_pose
from endoscope_core.physics import EffectSpec, PlantDescription, SensorModel, simulate
from endoscope_core.tip_force import State, TipForce, TipForceEstimator
from endoscope_core.tip_force.free_motion import LEAST, MOST, FreeMotion

Array = NDArray[np.float64]

LENGTH = 0.02
NAME = 'bend_x'
WALL_RAD, STIFFNESS = 0.25, 0.02


def _sweeps(seconds: float) -> Array:
    """Shaft commands (N, 1) in rad that go through the range both ways again and again."""
    time = np.arange(0.0, seconds, 1e-3)
    return 0.8 * np.sin(2.0 * math.pi * 0.25 * time)[:, None]


def _feed(
    estimator: TipForceEstimator,
    plant: PlantDescription,
    command: Array,
    begin: float = 0.0,
    seed: int = 1,
) -> tuple[list[TipForce], Array]:
    """Forces from a simulated motion, and the true angles at their times."""
    answer = simulate(plant, command)
    sensors = SensorModel(plant.sensors, seed)
    time = answer.time + begin
    estimator.motor.append(time, sensors.shaft_position(answer.shaft_position))
    estimator.wires.append(time, sensors.tension(answer.tension).reshape(len(time), -1))
    seen = slice(None, None, 25)
    estimator.tracker.append(time[seen], sensors.bending(answer.bending[seen]))
    found = estimator.update(float(time[-1]))
    at = [force.time for force in found]
    angles = [np.interp(at, time, column) for column in answer.bending_true.T]
    return found, np.stack(angles, axis=1)


def _calibrated(plant: PlantDescription) -> TipForceEstimator:
    estimator = TipForceEstimator(plant, LENGTH)
    estimator.free = True
    found, _ = _feed(estimator, plant, _sweeps(12.0))
    assert found, estimator.state
    estimator.free = False
    return estimator


def test_the_lever_is_the_way_of_the_tip_across_its_axis() -> None:
    step = 1e-4
    for bending in ((0.0, 0.0), (0.7, 0.0), (0.5, -0.9), (-1.2, 0.8)):
        _, (x, y, z, w) = tip_pose(bending, LENGTH)
        axes = np.array(
            [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)],
                [2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)],
            ]
        )
        for joint in range(2):
            moved = np.array(bending)
            moved[joint] += step
            way = axes @ (tip_pose(moved, LENGTH)[0] - tip_pose(bending, LENGTH)[0]) / step
            expected = np.zeros(2)
            expected[joint] = tip_lever(bending, LENGTH)
            assert way == pytest.approx(expected, abs=1e-6)


def test_an_obstacle_is_felt_with_its_force_and_free_motion_is_not() -> None:
    plant = PlantDescription(joints={NAME: replace(PlantDescription().joints[NAME])})
    estimator = _calibrated(plant)
    wall = EffectSpec('contact', NAME, {'angle_rad': WALL_RAD, 'stiffness': STIFFNESS})
    found, angles = _feed(estimator, replace(plant, effects=(wall,)), _sweeps(16.0), 20.0, 2)
    true = np.array(
        [
            -STIFFNESS * max(0.0, q - WALL_RAD) / tip_lever([q], LENGTH)
            for q in angles[:, 0].tolist()
        ]
    )
    force, low, high = (
        np.array([getattr(f, name)[0] for f in found]) for name in ('force', 'low', 'high')
    )
    seen = np.array([f.seen for f in found])
    pressed = true < 0.5 * true.min()
    assert pressed.any()
    assert np.median(np.abs(force - true)[pressed]) < 0.06 * -true.min()
    assert ((low <= true) & (true <= high)).mean() > 0.9
    assert seen[true < -2.0 * max(f.visible for f in found)].all()
    assert not seen[angles[:, 0] < WALL_RAD - 0.1].any()
    pressing = found[int(true.argmin())]
    assert pressing.at_least <= pressing.size <= pressing.at_most
    assert math.isnan(pressing.force[1])


def test_nothing_is_said_before_the_memory_and_the_bounds_are_known() -> None:
    plant = PlantDescription()
    estimator = TipForceEstimator(plant, LENGTH)
    assert not _feed(estimator, plant, np.zeros((2000, 2)))[0]
    assert estimator.state is State.UNKNOWN_MEMORY
    both = np.repeat(_sweeps(8.0), 2, axis=1)
    assert not _feed(estimator, plant, both, 2.001)[0]
    assert estimator.state is State.NOT_CALIBRATED


def test_after_a_gap_the_bounds_stay_and_the_memory_is_found_again() -> None:
    plant = PlantDescription(joints={NAME: PlantDescription().joints[NAME]})
    estimator = _calibrated(plant)
    found, _ = _feed(estimator, plant, _sweeps(10.0), 30.0)
    assert estimator.restarts == 1
    assert 'silent' in estimator.restarted_because
    assert min(f.time for f in found if f.time > 12.0) > 30.0 + 2.0
    assert estimator.state is State.KNOWN


def test_a_wire_that_is_tightened_is_no_force() -> None:
    plant = PlantDescription(joints={NAME: PlantDescription().joints[NAME]})
    estimator = _calibrated(plant)
    creep = EffectSpec('pretension_loss', NAME, {})
    found, _ = _feed(estimator, replace(plant, effects=(creep,)), _sweeps(20.0), 20.0, 3)
    assert len(found) > 400
    assert sum(f.seen for f in found) < 0.02 * len(found)


@pytest.mark.parametrize('stream', ['motor', 'wires', 'tracker'])
def test_numbers_that_are_none_start_anew(stream: str) -> None:
    plant = PlantDescription(joints={NAME: PlantDescription().joints[NAME]})
    estimator = _calibrated(plant)
    samples = getattr(estimator, stream)
    samples.append([samples.time[-1] + 1e-3], np.full(samples.columns, np.nan))
    streams = (estimator.motor, estimator.wires, estimator.tracker)
    time = max(each.time[-1] for each in streams)
    for each in streams:
        each.append(time + np.array([0.01, 0.02]), np.zeros((2, each.columns)))
    found = estimator.update(time + 1.0)
    assert np.isfinite([f.force[0] for f in found]).all()
    assert estimator.restarts == 1
    assert 'no numbers' in estimator.restarted_because


def test_the_least_that_is_seen_is_rare_and_what_few_excursions_show_is_doubted() -> None:
    generator = np.random.default_rng(1)
    excess = generator.exponential(1e-4, MOST)
    many, few = FreeMotion(), FreeMotion()
    for value in excess:
        assert not many.is_learnt
        many.learn(value, value, 1e-3, True)
    assert many.is_learnt
    # Of independent blocks, once in 20 h is once in 2,880,000.
    assert many.least_seen == pytest.approx(1e-4 * math.log(72_000.0 / 0.025), rel=0.05)
    assert many.bound == pytest.approx(np.quantile(excess, 0.95), rel=0.01)
    # The same excesses in three excursions say less of how large the next one is.
    for value in np.concatenate([np.sort(excess[k : k + 40]) for k in (0, 40, 80)]):
        few.learn(value, value, 1e-3, True)
    assert few.least_seen > 1.5 * many.least_seen
    few.forget()
    before = few.least_seen
    for _ in range(LEAST - 1):
        few.learn(0.0, 0.0, 0.0, True)
    assert few.least_seen == before
    few.learn(0.0, 0.0, 0.0, True)
    assert few.least_seen == 0.0
    # What may be a contact widens nothing.
    for _ in range(LEAST):
        few.learn(1e-3, 1e-3, 1e-3, False)
    assert few.least_seen == few.bound == 0.0


def test_bounds_are_learnt_on_until_something_is_seen() -> None:
    plant = PlantDescription(joints={NAME: PlantDescription().joints[NAME]})
    estimator = _calibrated(plant)
    before = estimator.free_motion[0].least_seen
    found, _ = _feed(estimator, plant, _sweeps(20.0), 30.0, 5)
    assert estimator.free_motion[0].least_seen < 0.8 * before
    assert not any(f.seen for f in found)


def test_noise_pushes_no_joint_at_rest_and_what_does_is_seen() -> None:
    plant = PlantDescription(joints={NAME: PlantDescription().joints[NAME]})
    estimator = _calibrated(plant)
    command = np.concatenate([_sweeps(12.0), np.zeros((17_000, 1))])
    fading = np.clip((11.0 - np.arange(len(command)) * 1e-3) / 2.0, 0.0, 1.0)
    push = {'moment_nm': 0.004, 'time_s': 27.0, 'duration_s': 0.2}
    pushed = replace(plant, effects=(EffectSpec('external_load', NAME, push),))
    found, _ = _feed(estimator, pushed, command * fading[:, None] ** 2, 30.0, 4)
    resting = [f for f in found if 30.0 + 11.5 < f.time < 30.0 + 26.9]
    assert len(resting) > 500
    assert not any(f.seen for f in resting)
    assert max(f.size for f in resting) < 0.02
    assert all(f.seen for f in found if f.time > 30.0 + 27.6)
