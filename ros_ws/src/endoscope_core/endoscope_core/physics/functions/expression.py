"""Formulas of one symbol as they stand in a plant.yaml: read as syntax, never run as code."""

import ast
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import nearest

Array = NDArray[np.float64]

LONGEST = 400
"""Characters of a formula."""
DEEPEST = 40
"""Operations within operations."""

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
