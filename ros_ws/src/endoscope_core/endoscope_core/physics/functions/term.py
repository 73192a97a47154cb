"""From an unknown term of a plant to the numbers of its function, and how well they hold it."""

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import TermSpec
from endoscope_core.physics.functions import describe_place
from endoscope_core.physics.functions.evaluation import function_at
from endoscope_core.physics.functions.expression import evaluate
from endoscope_core.physics.functions.places import LAGS_S, NODES, VALUES, Place, Shape

Array = NDArray[np.float64]

FINE = 20
"""Points a cell between the nodes at which a formula is checked."""
TOO_MUCH = 0.15
"""Rms error, as a share of what the formula spans, from which a table is another function: a jump
leaves 0.06, a sinusoid of too many periods 0.35 and more."""
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Table:
    """A function as the plant runs it."""

    # (VALUES + NODES or one more,): both ends of the range, then the values, then the time constant
    # of an argument that lags.
    numbers: Array
    # Of the table against the formula, as a share of what the formula spans; 0 for given values.
    largest_error: float = 0.0


@functools.lru_cache(maxsize=256)
def tabulated(term: TermSpec) -> Table:
    """The table of an unknown term; errors name the term and what to do."""
    place = describe_place(term.place)
    try:
        return _tabulated(term, place)
    except ValueError as error:
        raise ValueError(f'unknown_term at {term.place} on {term.joint}: {error}') from error


def _tabulated(term: TermSpec, place: Place) -> Table:
    low, high = _range(term, place)
    nodes = np.linspace(low, high, NODES)
    if bool(term.expression) == bool(term.values):
        raise ValueError('give either an expression or values')
    if term.values:
        values = np.array(term.values, dtype=np.float64)
        if len(values) != NODES:
            raise ValueError(f'{len(values)} values: give {NODES}, equally spaced over the range')
        if not np.all(np.isfinite(values)):
            raise ValueError('a value is not finite: give finite numbers')
        table = Table(np.array([low, high, *values]))
    else:
        values = evaluate(term.expression, place.argument.symbol, nodes)
        numbers = np.array([low, high, *values])
        table = Table(numbers, _largest_error(term.expression, place, numbers))
    _check_values(place, table, term.multiplies)
    return replace(table, numbers=np.append(table.numbers, _lag(term, place)))


def _lag(term: TermSpec, place: Place) -> tuple[float, ...]:
    if not place.argument.lags:
        if term.lag_s is not None:
            raise ValueError(f'lag_s is given: {place.argument.words} does not lag, leave it out')
        return ()
    low, high = LAGS_S
    lag = place.parameters[-1].typical if term.lag_s is None else term.lag_s
    if not low <= lag <= high:
        raise ValueError(f'lag_s is {lag:g}: give a time from {low:g} to {high:g} s')
    return (lag,)


def _range(term: TermSpec, place: Place) -> tuple[float, float]:
    argument = place.argument
    low, high = term.range or (argument.low, argument.high)
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f'range is {low:g} to {high:g}: give two finite numbers, the lower first')
    mirrored = place.shape in (Shape.ODD, Shape.EVEN)
    if mirrored and abs(low + high) > _ROUNDING * (high - low):
        raise ValueError(
            f'range is {low:g} to {high:g}: the function is {place.shape}, give as much on both '
            'sides of zero'
        )
    return low, high


def _largest_error(expression: str, place: Place, numbers: Array) -> float:
    low, high = numbers[:VALUES]
    fine = np.linspace(low, high, (NODES - 1) * FINE + 1)
    true = evaluate(expression, place.argument.symbol, fine)
    span = float(np.ptp(true))
    _check_shape(expression, place, true, span)
    if span == 0.0:
        return 0.0
    repeats = place.shape is Shape.PERIODIC
    run = np.array([function_at(numbers, 0, each, 0.0, 1.0, repeats)[0] for each in fine])
    error = np.abs(run - true) / span
    rms = float(np.sqrt(np.mean(error**2)))
    if rms > TOO_MUCH:
        raise ValueError(
            f'{expression!r} is too fine for {NODES} values from {low:g} to {high:g}: its table is '
            f'off by {100.0 * rms:.0f} % of what it spans; give a narrower range'
        )
    return float(error.max())


def _check_shape(expression: str, place: Place, true: Array, span: float) -> None:
    mirrored = true[::-1]
    size = _ROUNDING * max(span, float(np.abs(true).max()))
    wrong = {
        Shape.ODD: np.abs(true + mirrored).max() > size,
        Shape.EVEN: np.abs(true - mirrored).max() > size,
        Shape.PERIODIC: abs(true[0] - true[-1]) > size + 1e-6 * span,
    }
    if wrong.get(place.shape, False):
        symbol = place.argument.symbol
        like = {
            Shape.ODD: f'the place takes f(-{symbol}) = -f({symbol})',
            Shape.EVEN: f'the place takes f(-{symbol}) = f({symbol})',
            Shape.PERIODIC: 'the range is the period, and the function ends where it began',
        }
        raise ValueError(f'{expression!r} is not {place.shape}: {like[place.shape]}')


def _check_values(place: Place, table: Table, multiplies: bool) -> None:
    values = table.numbers[VALUES : VALUES + NODES]
    extreme = float(values[np.argmax(np.abs(values))])
    largest = place.largest_of(multiplies)
    if abs(extreme) > largest:
        unit = '' if place.unit == '-' or multiplies else f' {place.unit}'
        raise ValueError(
            f'the function reaches {extreme:.6g}{unit}: it must stay within +-{largest:g}{unit}'
        )
    if place.never_negative and not multiplies and values.min() < 0.0:
        raise ValueError(f'the function reaches {values.min():.6g}: it must not be negative')
