"""Feed-forward compensation of hysteresis by equation 5 of the first paper."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.hysteresis.bouc_wen import BoucWenParameters
from endoscope_core.hysteresis.bouc_wen_kernel import bouc_wen_normalised_step

Vector = Sequence[float] | NDArray[np.float64]

MODES = ('none', 'bouc_wen')


@dataclass(frozen=True)
class FeedforwardLaw:
    """What the compensator does with a desired angle.

    Parameters
    ----------
    mode : {'none', 'bouc_wen'}
        'none' passes the desired angle through.
    parameters : tuple of BoucWenParameters
        One for each joint; may be empty in mode 'none'.

    Raises
    ------
    ValueError
        If the mode is unknown, or 'bouc_wen' has no parameters: no motion is guessed.
    """

    mode: str = 'none'
    parameters: tuple[BoucWenParameters, ...] = ()

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ValueError(
                f'unknown compensation mode {self.mode!r}: choose one of {", ".join(MODES)}'
            )
        if self.mode == 'bouc_wen' and not self.parameters:
            raise ValueError("mode 'bouc_wen' needs parameters for each joint: calibrate first")


@dataclass(frozen=True)
class FeedforwardSettings:
    """How the feed-forward moves in time.

    Parameters
    ----------
    lead : float
        s by which the desired angle is foreseen, ``theta_d + lead theta_d'``: the servo's own lag,
        so that the motor has crossed the dead zone when the joint is to turn back. 0 gives equation
        5 as printed.
    speed_limit : float
        Greatest speed of the command in rad/s. A reversal at high acceleration asks for more; the
        motor could not follow it and a gate before the motor would refuse it.
    offset_rate : float
        Greatest speed in rad/s at which the jump left by a switch is worked off.
    offset_time : float
        Time constant in s of the last part of that.
    resting_travel : float
        rad over which the memory of the direction builds up while no parameters are known.
    """

    lead: float = 0.06
    speed_limit: float = 20.0
    offset_rate: float = 0.5
    offset_time: float = 0.3
    resting_travel: float = math.radians(1.0)

    def __post_init__(self) -> None:
        if not (0.0 <= self.lead <= 0.5):
            raise ValueError(f'lead = {self.lead} s must lie in [0, 0.5]')
        for name in ('speed_limit', 'offset_rate', 'offset_time', 'resting_travel'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f'{name} = {value} must be positive and finite')


@dataclass(frozen=True)
class FeedforwardState:
    """What the feed-forward remembers of one joint; angles in rad.

    Parameters
    ----------
    desired, foreseen : float
        Desired angle of the last step, as it was and `lead` later.
    command : float
        Joint-equivalent motor angle that it gave.
    hysteresis : float
        ``h / h_max`` in [-1, 1]. Kept normalised, so that it means the same after a change of
        parameters.
    offset : float
        What the last switch has left to be worked off; part of the command.
    """

    desired: float
    foreseen: float
    command: float
    hysteresis: float = 0.0
    offset: float = 0.0


def compensated_angle(
    parameters: BoucWenParameters | None, foreseen: float, hysteresis: float, desired: float
) -> float:
    """Equation 5 without the offset; the desired angle where there are no parameters."""
    if parameters is None:
        return desired
    return (foreseen + parameters.lag * hysteresis) / parameters.alpha


def feedforward_step(
    parameters: BoucWenParameters | None,
    active: bool,
    settings: FeedforwardSettings,
    state: FeedforwardState,
    desired: float,
    velocity: float,
    dt: float,
) -> FeedforwardState:
    """One step of one joint.

    Parameters
    ----------
    parameters : BoucWenParameters or None
        Of this joint; None where none are known.
    active : bool
        Whether they compensate; otherwise they only keep the memory of the motion up to date.
    settings : FeedforwardSettings
    state : FeedforwardState
    desired, velocity : float
        Desired angle and velocity, rad and rad/s.
    dt : float
        s since the last step.

    Returns
    -------
    FeedforwardState
        With the new command.
    """
    foreseen = desired + settings.lead * velocity
    moved = foreseen - state.foreseen
    if parameters is None:
        hysteresis = bouc_wen_normalised_step(
            state.hysteresis, moved, settings.resting_travel, 0.0, 1.0
        )
    else:
        hysteresis = bouc_wen_normalised_step(
            state.hysteresis, moved, parameters.travel, parameters.rho, parameters.n
        )
    worked_off = _limit(
        state.offset * min(1.0, dt / settings.offset_time), settings.offset_rate * dt
    )
    offset = state.offset - worked_off
    wanted = compensated_angle(parameters if active else None, foreseen, hysteresis, desired)
    step = _limit(wanted + offset - state.command, settings.speed_limit * dt)
    return FeedforwardState(desired, foreseen, state.command + step, hysteresis, offset)


class BoucWenFeedforward:
    """Feed-forward of all joints; its law can be changed while it runs without a jump.

    Parameters
    ----------
    joints : int
        Number of joints.
    settings : FeedforwardSettings, optional

    Notes
    -----
    Equation 4 is driven by the desired angle, not by the command, as in the paper; parameters are
    identified for that use. The command is bounded by ``(|theta_d| + lead |theta_d'| + lag) /
    alpha`` and its slope over the foreseen angle by `BoucWenParameters.inverse_slope`.
    """

    def __init__(self, joints: int, settings: FeedforwardSettings | None = None) -> None:
        self.settings = settings or FeedforwardSettings()
        self.law = FeedforwardLaw()
        self._joints = joints
        self._states: list[FeedforwardState] = []
        self._start: list[float] | None = None

    @property
    def command(self) -> NDArray[np.float64] | None:
        """Last command (J,) in rad, None before the first step."""
        return np.array([s.command for s in self._states]) if self._states else None

    @property
    def offset(self) -> NDArray[np.float64]:
        """What is left of the last switch, (J,) in rad; zero before the first step."""
        return np.array([s.offset for s in self._states] or [0.0] * self._joints)

    def select(self, law: FeedforwardLaw) -> None:
        """Put another law in force from the next step on; the command goes on from where it is.

        Raises
        ------
        ValueError
            If the law has parameters for another number of joints; the law in force stays.
        """
        if law.parameters and len(law.parameters) != self._joints:
            raise ValueError(
                f'parameters for {len(law.parameters)} joints given, {self._joints} wanted'
            )
        self.law = law
        if self._states:
            self.rebase([state.command for state in self._states])

    def rebase(self, command: Vector) -> None:
        """Go on from this command (J,) in rad, sent by someone else meanwhile, without a jump.

        Raises
        ------
        ValueError
            If the command has another size or is not finite.
        """
        start = self._checked('command', command)
        if not self._states:
            self._start = start
            return
        self._states = [
            replace(state, command=angle, offset=angle - self._uncorrected(j, state))
            for j, (state, angle) in enumerate(zip(self._states, start, strict=True))
        ]

    def step(self, desired: Vector, velocity: Vector, dt: float) -> NDArray[np.float64]:
        """Command for the desired angle.

        Parameters
        ----------
        desired, velocity : sequence of float, shape (J,)
            Desired angle and velocity, rad and rad/s.
        dt : float
            s since the last step, positive.

        Returns
        -------
        ndarray, shape (J,)
            Joint-equivalent motor angle in rad, without any feedback correction.

        Raises
        ------
        ValueError
            If an input has another size or is not finite, or `dt` is not positive; nothing changes
            then.
        """
        angles = self._checked('desired', desired)
        speeds = self._checked('velocity', velocity)
        if not (math.isfinite(dt) and dt > 0.0):
            raise ValueError(f'dt = {dt} s must be positive and finite')
        if not self._states:
            self._begin(angles, speeds)
        active = self.law.mode == 'bouc_wen'
        self._states = [
            feedforward_step(self._parameters(j), active, self.settings, state, angle, speed, dt)
            for j, (state, angle, speed) in enumerate(
                zip(self._states, angles, speeds, strict=True)
            )
        ]
        return np.array([state.command for state in self._states])

    def _begin(self, angles: list[float], speeds: list[float]) -> None:
        lead = self.settings.lead
        self._states = [
            FeedforwardState(angle, angle + lead * speed, angle)
            for angle, speed in zip(angles, speeds, strict=True)
        ]
        start = self._start
        if start is None:
            start = [self._uncorrected(j, state) for j, state in enumerate(self._states)]
        self.rebase(start)

    def _parameters(self, joint: int) -> BoucWenParameters | None:
        return self.law.parameters[joint] if self.law.parameters else None

    def _uncorrected(self, joint: int, state: FeedforwardState) -> float:
        parameters = self._parameters(joint) if self.law.mode == 'bouc_wen' else None
        return compensated_angle(parameters, state.foreseen, state.hysteresis, state.desired)

    def _checked(self, name: str, values: Vector) -> list[float]:
        numbers = [float(value) for value in values]
        if len(numbers) != self._joints or not all(map(math.isfinite, numbers)):
            raise ValueError(f'{name} must be {self._joints} finite numbers, not {numbers}')
        return numbers


def _limit(value: float, bound: float) -> float:
    return min(bound, max(-bound, value))
