"""From desired bending to shaft angles: whose commands are obeyed, and what goes out."""

from enum import StrEnum
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endoscope_core.choices import ADAPTIVE_PHYSICAL
from endoscope_core.compensation.law_in_force import LawInForce
from endoscope_core.control import (
    AdoptedPlant,
    AdoptionError,
    Corrections,
    DesiredMotion,
    Feedforward,
)
from endoscope_core.control.range_cut import RangeCut
from endoscope_core.kinematics import tip_lever
from endoscope_core.names import JOINTS, MOTOR_MEASURED, MOTORS, SLAVE_COMMAND
from endoscope_core.rig import Rig
from endoscope_core.safety import (
    AdoptionCode,
    CommandGate,
    CommandLimits,
    ContactGuard,
    GuardState,
    MotionLimits,
    MotionShaper,
    Refusal,
    StandingStill,
)

# The servo has followed a command by then but for 1 %: 6 / wm of the nominal one.
_REST_NS = 200_000_000
_FIRST_PERIOD_S = 1e-3
_AT_ZERO = (0.0,) * len(JOINTS)


class Commander(StrEnum):
    """Whose commands are obeyed."""

    NOBODY = 'nobody'
    MASTER = 'master'
    CALIBRATION = 'calibration'


class Command(NamedTuple):
    """Desired bending of J joints, in rad and rad/s."""

    stamp_ns: int
    position: tuple[float, ...]  # rad
    velocity: tuple[float, ...] = ()  # rad/s; empty where the message has none


class Measured(NamedTuple):
    """Where the slave is, (J,) in rad, as far as it is known."""

    bending: tuple[float, ...] | None
    shafts: tuple[float, ...] | None
    shafts_ns: int = 0  # monotonic time at which they came
    # Stamp in ns and bending of the tracker's newest measurement.
    tracked: tuple[int, tuple[float, ...]] | None = None


class CommandStream:
    """Turns commands into shaft angles (J,) in rad, those of one source at a time.

    Calibration goes before the master while its commands are fresh, and passes uncompensated.
    Every stream begins at the measured pose, and the shafts go on from where they are, whatever
    changes: source, law or feedback. Against a force at the tip the master's commands go on as
    `contact` lets them. All times are local and monotonic, in ns, but for stamps.
    """

    def __init__(self, rig: Rig, law: LawInForce) -> None:
        facts, shafts, timeout_ns = rig.joints, rig.motors, rig.timeouts.command_ns
        limits = CommandLimits(facts.reach, facts.speed, facts.entry_step, timeout_ns)
        self.gate, self.calibration_gate = CommandGate(limits), CommandGate(limits)
        self.correction_gate = CommandGate(
            CommandLimits(facts.correction, shafts.speed / facts.gear, facts.correction, timeout_ns)
        )
        most = (facts.drive * facts.gear, shafts.speed, shafts.acceleration, shafts.step)
        self.shaper = MotionShaper(MotionLimits.either_way(len(MOTORS), *most))
        self.source = Commander.NOBODY
        self.corrected = False  # whether a correction is added
        self.cut = RangeCut()
        tip, lever = rig.tip, partial(tip_lever, length=rig.instrument.section_length)
        speeds = tip.contact_speed, tip.release_speed
        self.contact = ContactGuard(JOINTS, tip.force_limit, *speeds, lever)
        self._law, self._gear, self._resolution = law, facts.gear, shafts.resolution
        self._passing = Feedforward(len(JOINTS), law.feedforward.settings)
        self._desired = DesiredMotion(len(JOINTS))
        self._corrections = Corrections(timeout_ns)
        self._answer = StandingStill(MOTORS, shafts.resolution)
        self._learnt_ns = self._stamp_ns = self._moved_ns = 0
        self._sent = self._rested_at = self._angle = _AT_ZERO

    def restart(self) -> None:
        """Forget all streams, as when a motion session begins or ends."""
        for gate in (self.gate, self.calibration_gate, self.correction_gate):
            gate.reset()
        self._corrections.restart()
        self._end()

    def end_master(self) -> None:
        """The clutch was released: whatever is commanded after it begins at the measured pose."""
        self.gate.reset()
        if self.source is Commander.MASTER:
            self._end()

    def correct(self, correction: Command, now_ns: int) -> None:
        """Take a correction, to be added to the master's commands after it."""
        stamp_ns, position, _ = correction
        if self.correction_gate.check(stamp_ns, position, now_ns, _AT_ZERO) is None:
            self._corrections.add(stamp_ns, position)

    def follow(
        self, command: Command, now_ns: int, measured: Measured, held: bool
    ) -> tuple[float, ...]:
        """Shaft angles for a command of the master; empty if it is refused.

        `held` says whether its clutch is.
        """
        if self.calibration_gate.is_fresh(now_ns):
            return ()
        if not held:
            self.gate.refuse(Refusal.CLUTCH)
            return ()
        step = self._obey(Commander.MASTER, self.gate, command, now_ns, measured.bending, measured)
        if step is None:
            return ()
        seconds, begins = step
        feedforward = self._law.feedforward
        if begins:
            self._desired.restart()
            self.contact.begin(measured.bending or command.position, now_ns)
        position, velocity = self.contact(command.position, command.velocity, seconds, now_ns)
        # A correction would push on for what the guard holds back.
        yields = self.contact.state is GuardState.YIELDING
        # This mode learns from the tracker itself.
        learns = feedforward.law.mode == ADAPTIVE_PHYSICAL
        correction = None if learns or yields else self._corrections.before(command.stamp_ns)
        added = np.zeros(len(JOINTS)) if correction is None else correction
        if begins or self.corrected != (correction is not None):
            self.corrected = correction is not None
            feedforward.rebase(self._drive_before() - added, position if begins else None)
        # Cut where the tube at hand lets the tip bend no more.
        self._angle, velocity = self.cut(self._law.ranges, position, velocity)
        angle, velocity = self._desired.follow(self._angle, velocity, seconds)
        if not any(velocity):
            self._law.take_pending()
        if not yields:
            self._learn(command.stamp_ns, measured)
        drive = feedforward.step(angle, velocity, seconds) + added
        return self._put_out(drive, seconds, now_ns)

    def calibrate(self, command: Command, now_ns: int, measured: Measured) -> tuple[float, ...]:
        """Shaft angles for a command of the calibration; empty if it is refused."""
        shafts = measured.shafts
        start = None if shafts is None else tuple(x / self._gear for x in shafts)
        step = self._obey(
            Commander.CALIBRATION, self.calibration_gate, command, now_ns, start, measured
        )
        if step is None:
            return ()
        seconds, begins = step
        self.contact.end()
        if begins:
            self._passing.rebase(self._drive_before(), command.position)
        drive = self._passing.step(command.position, command.velocity or _AT_ZERO, seconds)
        return self._put_out(drive, seconds, now_ns)

    def watch(self, now_ns: int, measured: Measured, held: bool) -> str:
        """Notice streams that have ended; why the motion session must end, or nothing."""
        reason = ''
        self.contact.look(now_ns)
        if self.source is Commander.MASTER and not self.gate.is_fresh(now_ns):
            self._end()
            if held:
                refused = f' ({self.gate.last_reason})' if self.gate.last_reason else ''
                reason = f'{SLAVE_COMMAND} ended while the clutch was held{refused}'
        elif self.source is Commander.CALIBRATION and not self.calibration_gate.is_fresh(now_ns):
            self._end()
        if self.source is Commander.NOBODY:
            self._law.take_pending()
            return reason
        # By the time of the measurement: motors that are silent do not stand still, and silence
        # has a reason of its own.
        return self._answer.look(self._sent, measured.shafts, measured.shafts_ns)

    def check_rest(self, now_ns: int, measured: Measured, plant: AdoptedPlant | None) -> None:
        """AdoptionError where the slave moves, or is bent further than a plant allows."""
        if now_ns - self._moved_ns < _REST_NS or self.source is Commander.CALIBRATION:
            raise AdoptionError(
                AdoptionCode.MOVING, 'the slave is moving: plants are exchanged only at rest'
            )
        if measured.bending is None:
            raise AdoptionError(
                AdoptionCode.NOT_MEASURED, f'{MOTOR_MEASURED} is silent: no pose is known'
            )
        if plant is not None:
            before = self._angle if self.source is Commander.MASTER else measured.bending
            plant.check_within(before, JOINTS)

    def _obey(
        self,
        source: Commander,
        gate: CommandGate,
        command: Command,
        now_ns: int,
        start: tuple[float, ...] | None,
        measured: Measured,
    ) -> tuple[float, bool] | None:
        """Time in s since the command before, and whether a stream begins; None if refused."""
        if start is None or measured.shafts is None:
            gate.refuse(Refusal.STEP, 'no measured position')
            return None
        stamp_ns, position, velocity = command
        if gate.check(stamp_ns, position, now_ns, start, velocity) is not None:
            return None
        goes_on = source is self.source and not gate.began
        seconds = (stamp_ns - self._stamp_ns) * 1e-9
        self._stamp_ns, self.source = stamp_ns, source
        if goes_on:
            return seconds, False
        self._sent = measured.shafts
        self.shaper.restart(self._sent)
        self._answer.restart()
        return _FIRST_PERIOD_S, True

    def _end(self) -> None:
        """Nobody's commands are obeyed; what comes next begins at the measured pose."""
        self.source = Commander.NOBODY
        self.contact.end()

    def _learn(self, stamp_ns: int, measured: Measured) -> None:
        """Give a measurement from before this command to the law, once."""
        if measured.tracked is None:
            return
        tracked_ns, bending = measured.tracked
        if self._learnt_ns < tracked_ns < stamp_ns:
            self._learnt_ns = tracked_ns
            self._law.feedforward.measure((stamp_ns - tracked_ns) * 1e-9, bending)

    def _put_out(
        self, drive: NDArray[np.float64], seconds: float, now_ns: int
    ) -> tuple[float, ...]:
        self._sent = self.shaper.shape([self._gear * angle for angle in drive.tolist()], seconds)
        away = max(abs(a - b) for a, b in zip(self._sent, self._rested_at, strict=True))
        if away > self._resolution:
            self._rested_at, self._moved_ns = self._sent, now_ns
        return self._sent

    def _drive_before(self) -> NDArray[np.float64]:
        """Joint-equivalent angles that went out last, or that a stream begins at, in rad."""
        return np.array(self._sent) / self._gear
