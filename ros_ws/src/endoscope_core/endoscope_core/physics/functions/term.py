"""From an unknown term of a plant, numbers or a formula, to the numbers of its function."""

import ast
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import nearest
from endoscope_core.physics.description import TermSpec
from endoscope_core.physics.functions import describe_place
from endoscope_core.physics.functions.evaluation import function_at
from endoscope_core.physics.functions.places import LAGS_S, NODES, VALUES, Place, Shape

Array = NDArray[np.float64]

LONGEST = 400
"""Characters of a formula."""
DEEPEST = 40
"""Operations within operations."""

# A formula is read as syntax, never run as code.
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.UAdd: np.positive,
    ast.USub: np.negative,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: getattr(np, name) for name in ('exp', 'log', 'tanh', 'sqrt', 'abs', 'sin', 'cos', 'sign')
}
_OF_SEVERAL: dict[str, Callable[..., Any]] = {'min': np.minimum, 'max': np.maximum}
_CONSTANTS = {'pi': math.pi}
_NAMES = (*_FUNCTIONS, *_OF_SEVERAL, *_CONSTANTS)

FINE = 20
"""Points a cell between the nodes at which a formula is checked."""
TOO_MUCH = 0.15
"""Rms error, as a share of what the formula spans, from which a table is another function: a jump
leaves 0.06, a sinusoid of too many periods 0.35 and more."""
_ROUNDING = 1e-9


def evaluate(expression: str, symbol: str, values: Array) -> Array:
    """Values (N,) of a formula of `symbol` at `values` (N,).

    It may hold numbers, pi, + - * / **, and exp, log, tanh, sqrt, abs, sin, cos, sign, min and max.
    A ValueError says what else is in it, or at which value it is not finite.
    """
    if len(expression) > LONGEST:
        raise ValueError(f'a formula of {len(expression)} characters: give {LONGEST} at most')
    try:
        tree = ast.parse(expression.strip(), mode='eval').body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise ValueError(f'{expression!r} is not a formula: write it as 0.5*{symbol}**2') from error
    with np.errstate(all='ignore'):
        found = np.broadcast_to(_value(tree, symbol, values, 0), values.shape)
    if not np.all(np.isfinite(found)):
        where = float(values[~np.isfinite(found)][0])
        raise ValueError(
            f'{expression!r} has no finite value at {symbol} = {where:.6g}: mind division by zero '
            'and logarithms and roots of what is not positive there'
        )
    return np.array(found, dtype=np.float64)


def _value(node: ast.expr, symbol: str, values: Array, depth: int) -> Any:
    if depth > DEEPEST:
        raise ValueError(f'more than {DEEPEST} operations within one another: write it shorter')

    def inner(part: ast.expr) -> Any:
        return _value(part, symbol, values, depth + 1)

    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            try:
                return np.float64(number)
            except OverflowError as error:
                raise ValueError('a number in it is too large') from error
        case ast.Name(id=name) if name == symbol:
            return values
        case ast.Name(id=name) if name in _CONSTANTS:
            return np.float64(_CONSTANTS[name])
        case ast.Name(id=name):
            raise ValueError(f'unknown name {name}: {nearest(name, (symbol, *_NAMES))}')
        case ast.UnaryOp(op=sign, operand=part) if type(sign) in _OPERATORS:
            return _OPERATORS[type(sign)](inner(part))
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            return _OPERATORS[type(operator)](inner(left), inner(right))
        case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]):
            return _call(name, [inner(part) for part in parts])
    raise ValueError(
        f'{ast.unparse(node)!r} is not one of numbers, {symbol}, + - * / **, {", ".join(_NAMES)}'
    )


def _call(name: str, parts: list[Any]) -> Any:
    if name in _FUNCTIONS:
        if len(parts) != 1:
            raise ValueError(f'{name} takes one argument, not {len(parts)}')
        return _FUNCTIONS[name](parts[0])
    if name in _OF_SEVERAL:
        if len(parts) < 2:
            raise ValueError(f'{name} takes two arguments or more, not {len(parts)}')
        result = parts[0]
        for part in parts[1:]:
            result = _OF_SEVERAL[name](result, part)
        return result
    raise ValueError(f'unknown function {name}: {nearest(name, (*_FUNCTIONS, *_OF_SEVERAL))}')


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
