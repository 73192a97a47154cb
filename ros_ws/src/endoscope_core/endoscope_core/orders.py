"""Orders to calibrate or to go home: when one may begin, what it commands, how it ends."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endoscope_core.calibration import (
    BendingRecord,
    CalibrationRun,
    CalibrationStep,
    TensionGapError,
    with_zeros,
    zero_errors,
)
from endoscope_core.calibration.calibration_run import (
    CALIBRATE,
    HOME,
    CalibrationCommand,
    OrderCode,
    OrderFeedback,
    OrderState,
)
from endoscope_core.classifier.classification import ClassifierError, UnseenTensionError
from endoscope_core.identification.plant_fit import PlantFitError
from endoscope_core.judgement import Judgement
from endoscope_core.names import JOINTS, MOTORS, WIRES
from endoscope_core.rig import Rig
from endoscope_core.safety import TensionGuard
from endoscope_core.safety.guards import TOLD_RAD
from endoscope_core.signals import SINUSOID, CalibrationMotion

Array = NDArray[np.float64]
Judge = Callable[[Array], Future[Judgement]]
"""Judges tensions (N, W) in N at 1 kHz."""

_TICK_NS = 1_000_000
_FED_NS = 100_000_000


class Pose(NamedTuple):
    """Where the slave is, as far as it was measured lately."""

    shafts: tuple[float, ...] | None  # (J,) in rad
    tip: tuple[float, ...] | None  # (J,) in rad, by the tracker


@dataclass(frozen=True)
class Ending:
    """How an order ended."""

    words: str
    code: OrderCode = OrderCode.NONE  # why it was aborted
    log: str = ''  # the same, or more, for the log; empty for nothing
    # Of a calibration, whose result has these.
    reason: str = ''
    judgement: Judgement | None = None  # None where it was aborted, or the tube is not known
    backlash: float | None = None  # size in rad, where the tracker could measure it
    zeros: Array | None = None  # what load cells read in N where their wires hang loose, (W,)


class Order(ABC):
    """One order while it is carried out, by the commands of a run."""

    name: ClassVar[str]

    def __init__(self, run: CalibrationRun, began_ns: int) -> None:
        self.run, self.began_ns = run, began_ns

    @property
    def phase(self) -> str:
        """What is done for it now."""
        step = self.run.step
        return 'judging' if step is CalibrationStep.DONE else step.name.lower()

    @abstractmethod
    def ending(self, pose: Pose) -> Ending | None:
        """How it has ended; None while it goes on."""

    def aborted(self, reason: str, code: OrderCode) -> Ending:
        """How it ends now."""
        words = f'aborted while {self.run.step}: {reason}'
        return Ending(words, code, words, reason)


class HomeOrder(Order):
    """The way home: it has ended well where the shafts are at zero, and only there."""

    name = HOME

    def ending(self, pose: Pose) -> Ending | None:
        if self.run.step is not CalibrationStep.DONE:
            return None
        away = [
            f'{name} at {x:.3f} rad'
            for name, x in zip(MOTORS, pose.shafts or (), strict=False)
            if abs(x) > TOLD_RAD
        ]
        if pose.shafts and not away:
            return Ending(_at_home(pose.tip))
        words = f'home is not reached: {" and ".join(away) or "nothing measured"} instead of 0'
        return Ending(words, OrderCode.NOT_REACHED, words)


def _at_home(tip: Sequence[float] | None) -> str:
    """What home is: by its friction the tube holds the tip where the wires left it."""
    if tip is None:
        return 'home reached: motors at zero'
    furthest = max(np.degrees(np.abs(tip)))
    return f'home reached: motors at zero; the tip is at {furthest:.0f} deg, the tube holds it'


class CalibrationOrder(Order):
    """A calibration: it has ended well once the tensions of its motion have been judged."""

    name = CALIBRATE

    def __init__(self, run: CalibrationRun, began_ns: int, motion: str, judge: Judge) -> None:
        super().__init__(run, began_ns)
        self.bending = BendingRecord(len(JOINTS))
        self._motion, self._judge = motion, judge
        self._zeros: Array | None = None
        self._judging: Future[Judgement] | None = None

    def ending(self, pose: Pose) -> Ending | None:
        record = self.run.record
        if record is not None and record.complete and self._judging is None:
            try:
                tension = record.resampled()
            except TensionGapError as error:
                return self.aborted(str(error), OrderCode.TENSION_GAP)
            self._zeros = zero_errors(tension)
            self._judging = self._judge(tension)
        if self.run.step is not CalibrationStep.DONE:
            return None
        if self._judging is None:
            return self.aborted(
                'the tensions of the last samples did not come', OrderCode.TENSION_GAP
            )
        return self._judged(self._judging) if self._judging.done() else None

    def _judged(self, judging: Future[Judgement]) -> Ending:
        error = judging.exception()
        if isinstance(error, UnseenTensionError):
            words = with_zeros(str(error), self._zeros)
            log = f'{words}; the motion is not compensated'
            return Ending(words, OrderCode.UNKNOWN_TUBE, log, str(error), zeros=self._zeros)
        if isinstance(error, ClassifierError | PlantFitError):
            return self.aborted(str(error), OrderCode.NOT_JUDGED)
        found = judging.result()
        backlash = None
        # Backlash size is that under the sinusoid: faster motion has a wider loop.
        if self.run.record is not None and self._motion == SINUSOID:
            backlash = self.bending.backlash_size(self.run.record.start_ns)
        named = f'class {found.verdict.class_deg} deg{found.lost_in_words()}'
        words = with_zeros(named, self._zeros)
        log = f'{words}, probability {found.verdict.probability:.3f}'
        return Ending(words, log=log, judgement=found, backlash=backlash, zeros=self._zeros)

    def aborted(self, reason: str, code: OrderCode) -> Ending:
        return replace(super().aborted(reason, code), words=f'aborted: {reason}')


class Orders:
    """One order of calibration at a time, aborted by whatever makes it worthless or doubtful.

    `return_speed`, in rad/s, and `rest`, in s, are those of :class:`CalibrationRun`; `remedy` is
    how to work without calibration.
    """

    def __init__(
        self,
        rig: Rig,
        motion: CalibrationMotion,
        judge: Judge,
        *,
        return_speed: float,
        rest: float,
        remedy: str,
    ) -> None:
        self.order: Order | None = None
        self.feedback = OrderFeedback()
        self.guard = TensionGuard(WIRES, rig.tension.calibration_ceiling)
        self.last = ''  # what came of the last order
        self.completed = self.aborted = self.refused = 0
        self._joints, self._motion, self._judge = rig.joints, motion, judge
        self._return_speed, self._rest = return_speed, rest
        self._newest = self._fed_ns = 0
        reach, amplitude = rig.joints.reach, motion.amplitude
        # A smaller motion is no way out: the classifier knows the tensions of this one alone.
        self._beyond_reach = (
            f'a calibration takes every joint {amplitude:.4g} rad either way, beyond joints.reach '
            f'{reach:g} of the rig; raise joints.reach where the instrument may be bent that far, '
            f'or work without calibration (`{remedy}`)'
            if amplitude > reach
            else ''
        )

    def begin(self, name: str, now_ns: int, session: str, pose: Pose, silent: str) -> OrderFeedback:
        """Begin an order, or say why not; `silent` says which stream that it needs is."""
        words, code = self._obstacle(name, session, silent)
        # Several may be given in one instant of simulated time.
        self._newest = max(self._newest + 1, now_ns)
        given = OrderFeedback(name, self._newest)
        if words or pose.shafts is None:
            self.last = f'{name}: {words}'
            return replace(given, state=OrderState.REJECTED, code=code, words=words)
        run = CalibrationRun(
            self._joints.entry([x / self._joints.gear for x in pose.shafts]),
            len(WIRES),
            _TICK_NS,
            self._return_speed,
            self._rest,
            name == HOME,
            self._motion,
        )
        self.order = (
            HomeOrder(run, now_ns)
            if name == HOME
            else CalibrationOrder(run, now_ns, self._motion.name, self._judge)
        )
        self.feedback = replace(
            given, state=OrderState.EXECUTING, phase=self.order.phase, words=str(run.step)
        )
        self._fed_ns = now_ns
        return self.feedback

    def _obstacle(self, name: str, session: str, silent: str) -> tuple[str, OrderCode]:
        """Why nothing can begin, in words (empty where it can) and as a code."""
        if self.order is not None:
            return f'busy: {self.order.run.step}', OrderCode.BUSY
        if name == CALIBRATE and self._beyond_reach:
            return self._beyond_reach, OrderCode.BEYOND_REACH
        if not session:
            return 'no motion session is open: the slave has to be ENABLED', OrderCode.NO_SESSION
        return self._doubt(silent)

    def _doubt(self, silent: str) -> tuple[str, OrderCode]:
        if self.guard.trouble:
            return self.guard.trouble, OrderCode.TENSION_CEILING
        return silent, OrderCode.STREAM_SILENT

    def add_tension(self, stamp_ns: int, tension: Sequence[float]) -> None:
        """Take a reading of all wires (W,) in N."""
        self.guard.update(tension)
        if self.order is not None:
            self.order.run.add_tension(stamp_ns, tension)

    def add_bending(self, stamp_ns: int, angle: Sequence[float]) -> None:
        """Take a measurement of the tracker (J,) in rad."""
        if isinstance(self.order, CalibrationOrder) and len(angle) == len(JOINTS):
            self.order.bending.add(stamp_ns, angle)

    def command(self, stamp_ns: int, periods: int) -> CalibrationCommand | None:
        """What to command in a tick, `periods` ms after the last; None for nothing."""
        order = self.order
        if order is None:
            return None
        command = order.run.command(stamp_ns, periods)
        if order.phase != self.feedback.phase or stamp_ns - self._fed_ns >= _FED_NS:
            self._fed_ns = stamp_ns
            self.feedback = replace(
                self.feedback,
                phase=order.phase,
                words=str(order.run.step),
                progress=order.run.progress,
            )
        return command

    def doubted(self, silent: str) -> Ending | None:
        """End the order where a stream that it needs is silent or a wire is pulled too hard."""
        words, code = self._doubt(silent)
        return self.abort(words, code) if words else None

    def ended(self, pose: Pose) -> Ending | None:
        """How the order has ended; None while it goes on, or there is none."""
        return self._end(None if self.order is None else self.order.ending(pose))

    def abort(self, reason: str, code: OrderCode) -> Ending | None:
        """End the order, if there is one."""
        return self._end(None if self.order is None else self.order.aborted(reason, code))

    def _end(self, ending: Ending | None) -> Ending | None:
        """End the order: the one place where that is done, counted and reported."""
        if ending is None or self.order is None:
            return None
        if ending.code is OrderCode.UNKNOWN_TUBE:
            self.refused += 1
        elif ending.code:
            self.aborted += 1
        elif self.order.name == CALIBRATE:
            self.completed += 1
        self.last = ending.words
        self.feedback = replace(
            self.feedback,
            state=OrderState.ABORTED if ending.code else OrderState.SUCCEEDED,
            code=ending.code,
            phase='',
            progress=1.0,
            words=ending.words,
        )
        self.order = None
        return ending
