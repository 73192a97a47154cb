"""Adaptive law against backlash of unknown size (second paper, section 2.4).

The correction ``v`` is added to a feed-forward ``u_ff``; a backlash-like transmission answers ``q =
a (u_ff + v) + d`` with unknown ``a > 0``. What the feed-forward leaves is written with the desired
angle ``theta`` and the direction memory ``s`` in [-1, 1] (which side of the backlash the desired
motion has taken up)::

    e = q - theta = a (v - g* theta - D* s) + eta,        |eta| <= a r*,   g*, D*, r* unknown
    w = e + lambda integral(e)                              integral surface
    v = g theta + D s - r tanh(w / epsilon)
    g' = -gamma_g w theta - sigma g                         adaptive gain, with leakage
    D' = -gamma_D w s - sigma D                             adaptive backlash, with leakage
    r' =  gamma_r (|w| - sigma_r r)                         adaptive bound of all the rest: |w|, for
    sgn(w) would let it fall below zero
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from endoscope_core.control.limits import COUNT, limited


def check_settings(settings: object, positive: Sequence[str]) -> None:
    """Refuse a setting that is not finite, or negative, or zero though among `positive`."""
    for name, value in vars(settings).items():
        if not (math.isfinite(value) and value >= 0.0):
            raise ValueError(f'{name} = {value} must be finite and not negative')
    for name in positive:
        if getattr(settings, name) == 0.0:
            raise ValueError(f'{name} must be positive')


@dataclass(frozen=True)
class AdaptiveBacklashSettings:
    """Gains and limits of the law; angles in rad, times in s."""

    # ``gamma_g`` (1/(rad^2 s)), ``gamma_D`` (1/s), ``gamma_r`` (1/s).
    gain_rate: float = 1.0
    backlash_rate: float = 2.0
    bound_rate: float = 0.05
    # ``sigma`` (1/s) and ``sigma_r`` (dimensionless).
    leakage: float = 0.005
    bound_leakage: float = 1.0
    integral_weight: float = 0.2  # ``lambda``, 1/s
    boundary_layer: float = math.radians(6.0)  # ``epsilon``, rad
    loop_gain: float = 0.3  # greatest ``r / epsilon``, below 1
    filter_time: float = 0.3  # time constant of the robust term
    # An error beyond counts as this much: the transient of a reversal is not to be learnt from.
    error_limit: float = math.radians(4.0)
    integral_limit: float = math.radians(2.0)  # limit of ``lambda integral(e)``
    # Projection of ``g`` and ``D``, limit of the correction.
    gain_limit: float = 0.5
    backlash_limit: float = math.radians(45.0)
    output_limit: float = math.radians(60.0)
    # rad of desired motion over which ``s`` turns round.
    direction_travel: float = math.radians(1.0)
    lead: float = 0.06  # s by which the desired angle is foreseen, as in the feed-forward
    # s from command to answer: the estimates learn from what was desired that long before the
    # measurement.
    response_delay: float = 0.06
    # rad by which the foreseen angle may turn back without any effect, as in the feed-forward.
    dead_band: float = 2.0 * COUNT

    def __post_init__(self) -> None:
        check_settings(
            self,
            ('boundary_layer', 'filter_time', 'error_limit', 'direction_travel', 'output_limit'),
        )
        if self.loop_gain >= 1.0:
            raise ValueError(
                f'loop_gain = {self.loop_gain} must stay below 1, '
                'or the loop through tanh is algebraic'
            )


@dataclass(frozen=True)
class AdaptationState:
    """Estimates of one joint."""

    gain: float = 0.0  # g
    backlash: float = 0.0  # D, rad
    bound: float = 0.0  # r, rad
    integral: float = 0.0  # lambda integral(e), rad
    surface: float = 0.0  # w, rad


def adapt(
    settings: AdaptiveBacklashSettings,
    state: AdaptationState,
    error: float,
    desired: float,
    direction: float,
    dt: float,
) -> AdaptationState:
    """Estimates after one tracker measurement, `dt` s after the one before.

    `error` in rad is the measured less the desired angle at the instant of the measurement;
    `desired` (``theta``, rad) and `direction` (``s``) are what the measured angle answers to.
    """
    # Lyapunov argument. With ``g~ = g - g*`` and so on, ``xi = integral(e)`` and
    #     V = a/2 (g~^2 / gamma_g + D~^2 / gamma_D + r~^2 / gamma_r) + lambda/2 xi^2
    # without leakage
    #     V' = -w (a g~ theta + a D~ s) + a r~ |w| + lambda xi e
    #        = -w (e + a r tanh(w/epsilon) - eta) + a (r - r*) |w| + lambda xi e
    #       <= -e^2 + a r (|w| - w tanh(w/epsilon)) <= -e^2 + 0.2785 epsilon a r,
    # because ``w e = e^2 + lambda xi e``. The error converges to a ball of radius
    # ``sqrt(0.2785 epsilon a r)``; leakage and projection keep every estimate bounded, at the price
    # of a constant in V' proportional to ``sigma``.
    c = settings
    bounded = limited(error, c.error_limit)
    integral = limited(state.integral + c.integral_weight * bounded * dt, c.integral_limit)
    w = bounded + integral
    gain = state.gain - dt * (c.gain_rate * w * desired + c.leakage * state.gain)
    backlash = state.backlash - dt * (c.backlash_rate * w * direction + c.leakage * state.backlash)
    bound = state.bound + dt * c.bound_rate * (abs(w) - c.bound_leakage * state.bound)
    return AdaptationState(
        gain=limited(gain, c.gain_limit),
        backlash=limited(backlash, c.backlash_limit),
        bound=min(max(bound, 0.0), c.loop_gain * c.boundary_layer),
        integral=integral,
        surface=w,
    )


def robust_term(settings: AdaptiveBacklashSettings, state: AdaptationState) -> float:
    """``-r tanh(w / epsilon)`` in rad, before its filter."""
    return -state.bound * math.tanh(state.surface / settings.boundary_layer)


def learnt_term(state: AdaptationState, desired: float, direction: float) -> float:
    """``g theta + D s`` in rad."""
    return state.gain * desired + state.backlash * direction


class AdaptiveBacklashJoint:
    """`adapt` with its state and the filter of the robust term."""

    def __init__(self, settings: AdaptiveBacklashSettings) -> None:
        self.settings = settings
        self.state = AdaptationState()
        self._robust = 0.0

    def learn(self, error: float, desired: float, direction: float, dt: float) -> None:
        self.state = adapt(self.settings, self.state, error, desired, direction, dt)

    def correction(self, desired: float, direction: float, dt: float) -> float:
        """``g theta + D s`` and the filtered robust term, rad."""
        # The argument needs `v` to act at once. The rig answers late (servo, tracker at 40 Hz) and
        # without memory in between, so that the loop through tanh would be algebraic: its gain
        # ``a r / epsilon`` is kept below one by projection of `r`, and the term is filtered. The
        # other terms are slow estimates times functions of the *desired* motion: they never turn
        # the motor back of their own accord, and tolerate delay.
        blend = min(1.0, dt / self.settings.filter_time)
        self._robust += blend * (robust_term(self.settings, self.state) - self._robust)
        return learnt_term(self.state, desired, direction) + self._robust
