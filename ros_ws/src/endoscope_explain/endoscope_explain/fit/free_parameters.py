"""Which numbers of a joint a fit may move, on which scale, within which bounds and priors."""

import math
from dataclasses import dataclass, replace

from endoscope_core.physics.description import NUMBERS, PlantNumber
from endoscope_core.physics.effect import Parameter
from endoscope_core.physics.effects import describe, lacking
from endoscope_core.physics.functions.places import HIGH, LAG, Place
from endoscope_core.physics.layout import FRICTION_PROFILE, NOMINAL_KEYS
from endoscope_explain.explanation import NINETY_PERCENT
from endoscope_explain.options import BAND
from endoscope_explain.recording import Array

LEAD = -1
"""Index that stands for the reading's lead, which is not a parameter of the plant."""
COEFFICIENT = -2
"""Index that stands for a coefficient of a free function."""
COORDINATE = 10.0
"""Coefficients in a coordinate of a fit, whose steps suit logarithms."""
_FURTHEST = 6.0
"""Standard deviations of its prior that a coefficient may reach."""
LEAD_PRIOR = (1.0, 0.5)
SCALED_NOMINAL = tuple(key for key in NOMINAL_KEYS if NUMBERS[key].scaled)
"""Numbers of the plant that are known but for a factor."""
FRICTION_PROFILE_NAMES = tuple(f'friction_profile_{term}' for term in (1, 2, 3))
"""Coefficients of the sheath's friction profile that are fitted."""
SCATTERED = {
    **{key: i for i, key in enumerate(NOMINAL_KEYS) if NUMBERS[key].spread},
    **{name: FRICTION_PROFILE + i for i, name in enumerate(FRICTION_PROFILE_NAMES)},
}
"""Places of the numbers that scatter from one healthy rig to the next: of what form it is, where
its joint rests, how its radii were machined."""
FITTED_NOMINAL = (*SCALED_NOMINAL, *SCATTERED)
BAND_SPREAD = 0.09


def nominal_number(name: str) -> PlantNumber:
    """What is known of a number of the nominal plant, or of a coefficient of its profile."""
    return NUMBERS['friction_profile' if name in FRICTION_PROFILE_NAMES else name]


def tolerance(name: str, described: float, band: float = BAND) -> tuple[float, float]:
    """Lowest and highest value of a nominal parameter that needs no explanation."""
    # Parameters may be larger, and smaller, by the factor `1 + band`. What describes a form may
    # differ by 90 % of what healthy rigs do.
    spread = nominal_number(name).spread
    if spread:
        reach = NINETY_PERCENT * spread
        return described - reach, described + reach
    return described / (1.0 + band), described * (1.0 + band)


@dataclass(frozen=True)
class FreeParameter:
    """A number that a fit may move."""

    index: int  # place in the packed parameters, or `LEAD`
    name: str
    # Whether the fit's coordinate is the logarithm; else it is the value over `unit`.
    logarithmic: bool
    unit: float  # size of one coordinate step on a scale that is not logarithmic
    # Bounds of the value.
    low: float
    high: float
    # Gaussian prior of the coordinate; an infinite spread is none.
    mean: float = 0.0
    spread: float = math.inf
    # Whether the fit's coordinate is the square of the value over `unit`: of what does nothing in
    # the first order.
    squared: bool = False

    def coordinate(self, value: float) -> float:
        """The fit's coordinate of a value."""
        value = min(max(value, self.low), self.high)
        if self.logarithmic:
            return math.log(value)
        return (value / self.unit) ** 2 if self.squared else value / self.unit

    def value(self, coordinate: float) -> float:
        """The value of a coordinate, kept within the bounds."""
        if self.logarithmic:
            # What the recording does not determine at all has bounds far beyond any number.
            value = math.exp(min(coordinate, math.log(self.high)))
        elif self.squared:
            value = math.sqrt(max(coordinate, 0.0)) * self.unit
        else:
            value = coordinate * self.unit
        return min(max(value, self.low), self.high)


def nominal_parameters(base: Array, band: float = BAND) -> tuple[FreeParameter, ...]:
    """The nominal plant's parameters around packed values `base`, and the reading's lead."""
    # Those of nominal physics that the plant lacks are not free; the fit may leave the band by a
    # third.
    free = []
    absent = {place for each in lacking(base) for place in each.places}
    for key in SCALED_NOMINAL:
        index = NOMINAL_KEYS.index(key)
        if index in absent:
            continue
        centre = float(base[index])
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
    share = min(band / BAND, 1.0)
    free += [
        _scattered(key, float(base[index]), share)
        for key, index in SCATTERED.items()
        if index not in absent
    ]
    mean, spread = LEAD_PRIOR
    free.append(FreeParameter(LEAD, 'reading_lead', False, 1.0, 0.0, 1.0, mean, spread))
    return tuple(free)


def _scattered(key: str, described: float, share: float) -> FreeParameter:
    known = nominal_number(key)
    item = FreeParameter(
        SCATTERED[key],
        key,
        False,
        known.spread,
        known.low,
        known.high,
        spread=share,
        squared=key == 'joint_presliding_spread',
    )
    return replace(item, mean=item.coordinate(described))


def with_free_reference(
    free: tuple[FreeParameter, ...], effect_id: str
) -> tuple[FreeParameter, ...]:
    """Widen the bounds of the nominal parameter that an effect scales over the recording."""
    # Whether a described value holds before or after a run-in is a matter of definition.
    rescales = describe(effect_id).traits.rescales
    if rescales is None:
        return free
    name, reach = rescales
    return tuple(
        replace(item, low=item.low / reach, high=item.high * reach) if item.name == name else item
        for item in free
    )


def effect_parameters(effect_id: str) -> tuple[FreeParameter, ...]:
    """The continuous parameters of an effect of the catalogue."""
    definition = describe(effect_id)
    return tuple(
        _of_effect(definition.first_parameter + i, parameter)
        for i, parameter in enumerate(definition.parameters)
        if not (parameter.choices or parameter.counted or parameter.is_duration)
    )


def _of_effect(index: int, parameter: Parameter) -> FreeParameter:
    positive = parameter.low > 0.0 and not math.isfinite(parameter.off)
    positive = positive or (parameter.name in SCALED_NOMINAL and parameter.off == parameter.high)
    unit = parameter.scale or abs(parameter.typical) or 0.1 * (parameter.high - parameter.low)
    return FreeParameter(index, parameter.name, positive, unit, parameter.low, parameter.high)


def time_scale(place: Place, low: float, high: float) -> FreeParameter:
    """The period of a function that repeats itself, or the lag of its argument."""
    # It is anywhere in between, evenly in its logarithm.
    name, index = ('lag', LAG) if place.argument.lags else ('period', HIGH)
    return FreeParameter(place.first_parameter + index, f'{place.id}_{name}', True, 1.0, low, high)


def coefficients(place_id: str, count: int) -> tuple[FreeParameter, ...]:
    """The coefficients of a function at a place, each normal with a variance of one."""
    return tuple(
        FreeParameter(
            COEFFICIENT,
            f'{place_id}_{k}',
            False,
            COORDINATE,
            -_FURTHEST,
            _FURTHEST,
            spread=1.0 / COORDINATE,
        )
        for k in range(count)
    )
