"""Whose commands a compensator obeys, and what goes out, without ROS."""

import numpy as np
import pytest

from endoscope_core.compensation.command_stream import Command, Commander, CommandStream, Measured
from endoscope_core.compensation.law_in_force import LawInForce, Selection
from endoscope_core.control import AdoptionError, Feedforward, FeedforwardSettings, MotorLimits
from endoscope_core.identification.law_choice import CalibrationFindings, LawChoice
from endoscope_core.rig import shipped_rig
from endoscope_core.safety import AdoptionCode, BendingRange, FeltForce, Refusal
from endoscope_core.safety.contact_guard import CERTAIN

RIG = shipped_rig()
GEAR = RIG.joints.gear
MS = 1_000_000
REST = (0.0, 0.0)


class Slave:
    """Shafts that are where they were sent, and a clock."""

    def __init__(self, ranges=()):
        self.law = LawInForce(
            Feedforward(2, FeedforwardSettings(MotorLimits.of(RIG))),
            LawChoice(2),
            Selection('none', 'class'),
        )
        self.law.findings = CalibrationFindings(ranges=ranges)
        self.stream = CommandStream(RIG, self.law)
        self.now_ns, self.shafts, self.held = 1_000 * MS, REST, True

    @property
    def measured(self):
        bending = None if self.shafts is None else tuple(x / GEAR for x in self.shafts)
        return Measured(bending, self.shafts, self.now_ns)

    def command(self, angle, source=Commander.MASTER):
        """Command the first joint; what goes out."""
        self.now_ns += MS
        command = Command(self.now_ns, (angle, 0.0))
        if source is Commander.MASTER:
            out = self.stream.follow(command, self.now_ns, self.measured, self.held)
        else:
            out = self.stream.calibrate(command, self.now_ns, self.measured)
        if out:
            self.shafts = out
        return out

    def feel(self, force):
        """Have a force on the first joint that is certain, in N."""
        for k in range(CERTAIN):
            low, high = (force - 0.02, 0.0), (force + 0.02 - 1e-6 * k, 0.0)
            self.stream.contact.feel(FeltForce(self.now_ns, (force, 0.0), low, high))

    def watch(self, pause_ms=0):
        self.now_ns += pause_ms * MS
        return self.stream.watch(self.now_ns, self.measured, self.held)


def test_a_stream_begins_at_the_measured_pose_and_goes_on_without_a_jump():
    slave = Slave()
    slave.shafts = (0.2 * GEAR, 0.0)
    angles = 0.2 + 0.3 * np.linspace(0.0, 1.0, 500) ** 2
    out = np.array([slave.command(angle) for angle in angles])
    assert out[0] == pytest.approx((0.2 * GEAR, 0.0), abs=1e-9)
    assert np.abs(np.diff(out, axis=0)).max() < 0.01
    assert out[-1, 0] == pytest.approx(0.5 * GEAR, abs=0.01)


def test_nothing_moves_without_a_measured_position_or_the_clutch():
    slave = Slave()
    slave.shafts = None
    assert slave.command(0.0) == ()
    assert slave.stream.gate.refused[Refusal.STEP] == 1
    slave.shafts, slave.held = REST, False
    assert slave.command(0.0) == ()
    assert slave.stream.gate.refused[Refusal.CLUTCH] == 1


def test_calibration_goes_before_the_master():
    slave = Slave()
    assert slave.command(0.0)
    assert slave.command(0.0, Commander.CALIBRATION)
    assert slave.command(0.0) == ()
    assert slave.stream.source is Commander.CALIBRATION
    assert slave.watch(pause_ms=150) == ''
    assert slave.stream.source is Commander.NOBODY
    assert slave.command(0.0)


def test_a_master_that_falls_silent_while_the_clutch_is_held_ends_the_session():
    slave = Slave()
    assert slave.command(0.0)
    assert slave.watch() == ''
    assert slave.watch(pause_ms=150) == 'slave/servo_jp ended while the clutch was held'
    assert slave.command(0.0)
    slave.stream.end_master()
    slave.held = False
    assert slave.watch(pause_ms=150) == ''


def test_motors_that_do_not_answer_end_the_session():
    slave, reason = Slave(), ''
    for k in range(1_000):
        slave.command(0.3 * (k / 1_000) ** 2 + 0.01 * min(k / 100, 1.0))
        slave.shafts = REST
        reason = reason or slave.watch()
    assert reason.startswith('motor_x stands still')


def test_a_new_calibration_comes_into_force_at_rest():
    slave = Slave()
    found = CalibrationFindings(class_deg=70)
    for k in range(200):
        slave.command(0.001 * k)
    slave.law.pending = (found,)
    slave.command(0.2)
    assert slave.law.findings != found
    slave.watch(pause_ms=150)
    assert slave.law.findings == found


def test_what_the_tube_does_not_allow_is_cut_and_reported_once():
    ranges = (BendingRange(-0.1, 0.1),) * 2
    slave = Slave(ranges)
    for k in range(500):
        slave.command(0.001 * k)
    assert slave.shafts[0] == pytest.approx(0.1 * GEAR, abs=0.01)
    assert slave.stream.cut.report().endswith('more was asked for')
    assert slave.stream.cut.report() == ''


def test_a_correction_is_added_and_leaves_without_a_jump():
    slave, out = Slave(), []
    for k in range(400):
        if 100 <= k < 200:
            slave.stream.correct(Command(slave.now_ns, (0.05, 0.0)), slave.now_ns)
        out.append(slave.command(0.0005 * k))
        assert slave.stream.corrected == (100 <= k < 199 + RIG.timeouts.command_ns // MS)
    assert np.abs(np.diff(out, axis=0)).max() < 0.02


def test_plants_are_exchanged_only_at_rest():
    slave = Slave()

    def refusal():
        with pytest.raises(AdoptionError) as error:
            slave.stream.check_rest(slave.now_ns, slave.measured, None)
        return error.value.code

    for k in range(100):
        slave.command(0.001 * k)
    assert refusal() == AdoptionCode.MOVING
    slave.now_ns += 300 * MS
    slave.stream.check_rest(slave.now_ns, slave.measured, None)
    slave.shafts = None
    assert refusal() == AdoptionCode.NOT_MEASURED
    slave.shafts = REST
    slave.command(0.0, Commander.CALIBRATION)
    assert refusal() == AdoptionCode.MOVING


def test_the_master_goes_on_slowly_against_a_force_and_calibration_freely():
    slave, angles = Slave(), 0.001 * np.arange(200)
    for angle in angles:
        slave.command(angle)
    slave.feel(-0.3)
    before = slave.shafts[0]
    for angle in angles:
        slave.command(0.2 + angle)
    # Twice what 0.1 mm/s are in that time, and the last of the motion before.
    assert slave.shafts[0] - before < 2.0 * 0.01 * 0.2 * GEAR + 0.01
    assert slave.stream.contact.in_words().startswith('yielding: bend_x pushes')
    begin = slave.shafts[0] / GEAR
    for angle in angles:
        slave.command(begin + angle, Commander.CALIBRATION)
    assert slave.shafts[0] / GEAR == pytest.approx(begin + angles[-1], abs=0.01)


def test_a_correction_does_not_push_on_where_the_guard_holds():
    slave = Slave()
    for k in range(100):
        slave.command(0.0005 * k)
    slave.feel(-0.3)
    before = slave.shafts[0]
    for _ in range(100):
        slave.stream.correct(Command(slave.now_ns, (0.2, 0.0)), slave.now_ns)
        slave.command(0.0005 * 99)
        slave.feel(-0.3)
    assert not slave.stream.corrected
    assert abs(slave.shafts[0] - before) < 0.01


def test_a_stream_that_begins_against_a_force_begins_where_the_slave_is():
    slave = Slave()
    slave.feel(-0.3)
    for _ in range(20):
        slave.command(0.05)
    assert slave.shafts[0] < 0.2 * 0.02 * GEAR + 1e-6
