"""Feed-forward compensation of hysteresis by equation 5 of the first paper, for any number of
joints.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.hysteresis.bouc_wen import BoucWenParameters
from endoscope_core.hysteresis.bouc_wen_kernel import bouc_wen_normalised_step

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
    offset_rate : float
        Greatest speed in rad/s at which the jump left by a switch is worked off.
    offset_time : float
        Time constant in s of the last part of that.
    resting_travel : float
        rad over which the memory of the direction builds up while no parameters are known.
    """

    lead: float = 0.06
    offset_rate: float = 0.5
    offset_time: float = 0.3
    resting_travel: float = math.radians(1.0)

    def __post_init__(self) -> None:
        if not (0.0 <= self.lead <= 0.5):
            raise ValueError(f'lead = {self.lead} s must lie in [0, 0.5]')
        for name in ('offset_rate', 'offset_time', 'resting_travel'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f'{name} = {value} must be positive and finite')


@dataclass(frozen=True)
class FeedforwardState:
    """What the feed-forward remembers of one joint.

    Parameters
    ----------
    driver : float
        Foreseen desired angle of the last step, rad.
    hysteresis : float
        ``h / h_max`` in [-1, 1]. Kept normalised, so that it means the same after a change of
        parameters.
    offset : float
        rad that the last switch has left to be worked off; part of the command.
    """

    driver: float
    hysteresis: float = 0.0
    offset: float = 0.0


def compensated_angle(parameters: BoucWenParameters | None, state: FeedforwardState) -> float:
    """Equation 5 without the offset; the driver itself where there are no parameters."""
    if parameters is None:
        return state.driver
    return (state.driver + parameters.lag * state.hysteresis) / parameters.alpha


def feedforward_step(
    parameters: BoucWenParameters | None,
    active: bool,
    settings: FeedforwardSettings,
    state: FeedforwardState,
    desired: float,
    velocity: float,
    dt: float,
) -> tuple[FeedforwardState, float]:
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
    state : FeedforwardState
    command : float
        Joint-equivalent motor angle in rad.
    """
    driver = desired + (settings.lead * velocity if active else 0.0)
    travel = settings.resting_travel if parameters is None else parameters.travel
    rho = 0.0 if parameters is None else parameters.rho
    n = 1.0 if parameters is None else parameters.n
    hysteresis = bouc_wen_normalised_step(state.hysteresis, driver - state.driver, travel, rho, n)
    limit = settings.offset_rate * dt
    decay = min(limit, max(-limit, state.offset * min(1.0, dt / settings.offset_time)))
    new = FeedforwardState(driver, hysteresis, state.offset - decay)
    return new, compensated_angle(parameters if active else None, new) + new.offset


class BoucWenFeedforward:
    """Feed-forward of all joints, whose law can be changed while it runs without a jump of the
    command.

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
        self._command: list[float] = []

    @property
    def command(self) -> NDArray[np.float64] | None:
        """Last command (J,) in rad, None before the first step."""
        return np.array(self._command) if self._command else None

    @property
    def offset(self) -> NDArray[np.float64]:
        """What is left of the last switch, (J,) in rad."""
        return (
            np.array([state.offset for state in self._states])
            if self._states
            else np.zeros(self._joints)
        )

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
        if self._command:
            self.rebase(self._command)

    def rebase(self, command: Sequence[float] | NDArray[np.float64]) -> None:
        """Go on from this command (J,) in rad, sent by someone else meanwhile, without a jump.

        Raises
        ------
        ValueError
            If the command has another size or is not finite.
        """
        start = self._checked('command', command)
        if not self._states:
            self._states = [FeedforwardState(angle) for angle in start]
        self._command = start
        active = self.law.mode == 'bouc_wen'
        self._states = [
            replace(state, offset=angle - compensated_angle(parameters if active else None, state))
            for state, parameters, angle in zip(
                self._states, self._parameters(), start, strict=True
            )
        ]

    def step(self, desired: ArrayLike, velocity: ArrayLike, dt: float) -> NDArray[np.float64]:
        """Command for the desired angle.

        Parameters
        ----------
        desired, velocity : array_like, shape (J,)
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
        states = self._states or [FeedforwardState(angle) for angle in angles]
        active = self.law.mode == 'bouc_wen'
        results = [
            feedforward_step(parameters, active, self.settings, state, angle, speed, dt)
            for parameters, state, angle, speed in zip(
                self._parameters(), states, angles, speeds, strict=True
            )
        ]
        self._states = [result[0] for result in results]
        self._command = [result[1] for result in results]
        return np.array(self._command)

    def _parameters(self) -> Sequence[BoucWenParameters | None]:
        return self.law.parameters or [None] * self._joints

    def _checked(self, name: str, values: ArrayLike) -> list[float]:
        array = np.asarray(values, dtype=float)
        if array.shape != (self._joints,) or not np.all(np.isfinite(array)):
            raise ValueError(f'{name} must be {self._joints} finite numbers, not {array.tolist()}')
        return [float(value) for value in array]
