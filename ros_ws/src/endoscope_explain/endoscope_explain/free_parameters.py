"""Which numbers of a joint a fit may move, on which scale, within which bounds and priors."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import CATALOGUE, EffectParameter
from endoscope_core.effects.slots import NOMINAL_KEYS, START_FRICTION

Array = NDArray[np.float64]

LEAD = -1
"""Index that stands for the reading's lead, which is not a parameter of the plant."""
LEAD_PRIOR = (1.0, 0.5)
FITTED_NOMINAL = tuple(key for key in NOMINAL_KEYS if key not in ('joint_radius', 'pulley_radius'))
"""Radii are drawn and machined; every other number of the plant is only known roughly."""
BAND = 0.15
"""Relative tolerance by which a healthy rig differs from its description."""
BAND_SPREAD = 0.09
SCALED = {'friction_run_in': ('capstan_exponent', 1.8)}
"""Nominal parameter that an effect scales by so much that its described value is ambiguous."""


@dataclass(frozen=True)
class FreeParameter:
    """A number that a fit may move.

    Attributes
    ----------
    index : int
        Place in the packed parameters, or `LEAD`.
    name : str
    logarithmic : bool
        Whether the fit's coordinate is the logarithm; else it is the value over `unit`.
    unit : float
        Size of one coordinate step on a linear scale.
    low, high : float
        Bounds of the value.
    mean, spread : float
        Gaussian prior of the coordinate; an infinite spread is no prior.
    """

    index: int
    name: str
    logarithmic: bool
    unit: float
    low: float
    high: float
    mean: float = 0.0
    spread: float = math.inf

    def coordinate(self, value: float) -> float:
        """The fit's coordinate of a value."""
        value = min(max(value, self.low), self.high)
        return math.log(value) if self.logarithmic else value / self.unit

    def value(self, coordinate: float) -> float:
        """The value of a coordinate, kept within the bounds."""
        if self.logarithmic:
            # What the recording does not determine at all has bounds far beyond any number.
            coordinate = min(coordinate, math.log(self.high))
        value = math.exp(coordinate) if self.logarithmic else coordinate * self.unit
        return min(max(value, self.low), self.high)


TIGHTENED = FreeParameter(START_FRICTION, 'start_friction', False, 1.0, -1.0, 1.0, 0.5, 0.5)
"""Friction that tightening the wires from the motor's side may have left at the start."""


def nominal_parameters(
    base: Array, band: float = BAND, *, tightened: bool = False
) -> tuple[FreeParameter, ...]:
    """The nominal plant's parameters around packed values `base`, and the reading's lead.

    Parameters
    ----------
    base : array (parameters,)
        Packed parameters as described.
    band : float
        Relative deviation that the fit may not leave by more than a third.
    tightened : bool
        Whether friction may hold the wires at the start.

    Returns
    -------
    tuple of FreeParameter
    """
    free = []
    for key in FITTED_NOMINAL:
        index = NOMINAL_KEYS.index(key)
        centre = float(base[index])
        if centre <= 0.0:
            continue
        reach = 1.0 + band * 4.0 / 3.0
        free.append(
            FreeParameter(
                index,
                key,
                True,
                1.0,
                centre / reach,
                centre * reach,
                math.log(centre),
                BAND_SPREAD * band / BAND,
            )
        )
    mean, spread = LEAD_PRIOR
    free.append(FreeParameter(LEAD, 'reading_lead', False, 1.0, 0.0, 1.0, mean, spread))
    return (*free, TIGHTENED) if tightened else tuple(free)


def with_free_reference(
    free: tuple[FreeParameter, ...], effect_id: str
) -> tuple[FreeParameter, ...]:
    """Widen the bounds of the nominal parameter that an effect scales over the recording.

    Whether a described value holds before or after a run-in is a matter of definition.
    """
    if effect_id not in SCALED:
        return free
    name, reach = SCALED[effect_id]
    return tuple(
        replace(item, low=item.low / reach, high=item.high * reach) if item.name == name else item
        for item in free
    )


def effect_parameters(effect_id: str) -> tuple[FreeParameter, ...]:
    """The continuous parameters of an effect of the catalogue."""
    definition = CATALOGUE[effect_id]
    return tuple(
        _of_effect(definition.first_parameter + i, parameter)
        for i, parameter in enumerate(definition.parameters)
        if not (parameter.choices or parameter.counted or parameter.is_duration)
    )


def _of_effect(index: int, parameter: EffectParameter) -> FreeParameter:
    positive = parameter.low > 0.0 and not math.isfinite(parameter.off)
    unit = parameter.scale or abs(parameter.typical) or 0.1 * (parameter.high - parameter.low)
    return FreeParameter(index, parameter.name, positive, unit, parameter.low, parameter.high)
