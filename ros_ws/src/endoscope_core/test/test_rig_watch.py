"""A watch is quiet on a rig within 10 % of its description, and names the part that changes."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.monitoring import Part, RigWatch
from endoscope_core.monitoring.jump_test import JumpTest, ResidualBlock
from endoscope_core.physics import EffectSpec, JointParameters, PlantDescription, simulate
from endoscope_core.signals.motions import teleoperation_like

SECONDS = 80
CHANGED_AT = 64.0


def hand(seed, seconds=SECONDS):
    time = np.arange(0.0, seconds, 1e-3)
    angle = teleoperation_like(seed, seconds, 1.0)(time)[0]
    return time, 0.5 * angle[:, None]


def rig(**effect):
    joint = JointParameters(
        capstan_exponent=0.84, joint_friction=9.6e-4, wire_stiffness=2850.0, motor_bandwidth=31.0
    )
    effects = tuple(EffectSpec(key, 'bend_x', values) for key, values in effect.items())
    return PlantDescription(joints={'bend_x': joint}, effects=effects)


def described():
    return PlantDescription(joints={'bend_x': JointParameters()})


def read(plant, setpoint, seed=1):
    noise = np.random.default_rng(seed)
    seen = simulate(plant, setpoint)
    size = seen.tension.shape
    return replace(
        seen,
        tension=seen.tension + 0.02 * noise.standard_normal(size),
        bending=seen.bending + 0.00436 * noise.standard_normal(seen.bending.shape),
    )


def feed(watch, time, setpoint, seen, part=slice(None), wires=None):
    at = time[part]
    watch.setpoint.append(at, setpoint[part])
    watch.motor.append(at, np.hstack([seen.shaft_position, seen.shaft_effort])[part])
    tension = seen.tension if wires is None else wires
    watch.wires.append(at, tension[part].reshape(len(at), -1))
    watch.tracker.append(at[::25], seen.bending[part][::25])
    watch.update(float(at[-1]))


def test_a_rig_that_stays_as_it_is_raises_no_alarm():
    time, setpoint = hand(3)
    watch = RigWatch(described())
    feed(watch, time, setpoint, read(rig(), setpoint))
    assert watch.ready
    assert watch.alarms == []
    assert watch.margin < 1.0


def test_a_cell_that_reads_too_much_is_reported_with_its_part_and_time():
    time, setpoint = hand(3)
    seen = read(rig(), setpoint)
    wires = seen.tension.copy()
    wires[time >= CHANGED_AT, 0, 1] *= 1.2
    watch = RigWatch(described())
    feed(watch, time, setpoint, seen, wires=wires)
    (alarm,) = watch.alarms
    assert CHANGED_AT < alarm.at < CHANGED_AT + 10.0
    assert alarm.since == pytest.approx(CHANGED_AT, abs=3.0)
    assert alarm.parts == (Part.CELL,)
    assert alarm.change == 'gain of the negative cell'
    # What has changed is not learnt as the rig's own.
    assert [joint.test.learning for joint in watch.joints] == [False]
    assert alarm.margin > 1.0


def test_samples_may_come_in_any_portions():
    time, setpoint = hand(3, 12)
    seen = read(rig(), setpoint)
    whole, pieces = RigWatch(described()), RigWatch(described())
    feed(whole, time, setpoint, seen)
    for begin in range(0, len(time), 70):
        feed(pieces, time, setpoint, seen, slice(begin, begin + 70))
    learnt = [joint.test.noise for watch in (whole, pieces) for joint in watch.joints]
    assert whole.joints[0].moved == pieces.joints[0].moved > 10
    # A tracker sample more or less, where a portion of 25 begins anew.
    np.testing.assert_allclose(learnt[0][:4], learnt[1][:4], rtol=1e-6)


@pytest.mark.parametrize(
    ('spoil', 'because'),
    [
        (lambda time, motor: (time, np.where(time[:, None] > 8.0, np.nan, motor)), 'no numbers'),
        (lambda time, motor: (np.where(time > 8.0, time + 3.0, time), motor), 'silent'),
        (lambda time, motor: (np.where(time > 8.0, time - 7.0, time), motor), 'jumped back'),
    ],
)
def test_what_cannot_be_followed_restarts_and_is_reported(spoil, because):
    time, setpoint = hand(3, 12)
    seen = read(rig(), setpoint)
    watch = RigWatch(described())
    at, motor = spoil(time, np.hstack([seen.shaft_position, seen.shaft_effort]))
    watch.setpoint.append(at, setpoint)
    watch.motor.append(at, motor)
    watch.update(12.0)
    assert watch.restarts >= 1
    assert because in watch.restarted_because
    assert watch.alarms == []


def test_missing_tensions_and_angles_are_no_change():
    time, setpoint = hand(3)
    seen = read(rig(), setpoint)
    gone = replace(
        seen,
        tension=np.where(time[:, None, None] > CHANGED_AT, np.nan, seen.tension),
        bending=np.where(time[:, None] > CHANGED_AT, np.nan, seen.bending),
    )
    watch = RigWatch(described())
    feed(watch, time, setpoint, gone)
    assert watch.alarms == []


def test_a_jump_is_found_where_it_is_and_a_drift_is_not_one():
    rng = np.random.default_rng(2)
    windows = np.array([1, 4, 16])
    unit = np.ones(1)

    def run(offsets):
        test = JumpTest(unit, 0.02 * unit, np.eye(1), np.array([False]), 0.1 * unit, unit, windows)
        return [
            test.add(ResidualBlock.of(offset + rng.normal(size=(50, 1)), np.ones((50, 1, 1))))
            for offset in offsets
        ]

    drifting = [jumps.gain.max() for jumps in run(np.linspace(0.0, 1.0, 200))[40:]]
    jumping = run([0.0] * 100 + [1.5] * 8)
    assert jumping[-1].gain.max() > 3.0 * max(drifting)
    assert jumping[-1].size[1, 0] == pytest.approx(1.5, abs=0.5)
