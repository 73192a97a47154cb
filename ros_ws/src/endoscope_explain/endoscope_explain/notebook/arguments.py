"""Arguments of a call, held to its signature."""

import inspect
import re
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import wraps
from numbers import Integral, Real
from pathlib import Path
from types import MappingProxyType, NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from endoscope_core.errors import EndoscopeError, InputError, nearest

SCRATCH = 'endoscope-arrays-'
"""What the name of a folder begins with that holds a recording only as long as its arrays live."""
_FOLDER = re.compile(rf'{re.escape(str(Path(tempfile.gettempdir()) / SCRATCH))}[^/]*/')
_OPTIONS = '**options\n        As of the command.'
_NUMBERS = {int: Integral, float: Real}


def checked[**P, Result](
    call: Callable[P, Result], options: Mapping[str, Mapping[str, Any]] = MappingProxyType({})
) -> Callable[P, Result]:
    """Refuse arguments of another type, or that an option does not allow, in one line."""
    # No folder is named that nobody made.
    signature = inspect.signature(call)
    hints = {name: one.annotation for name, one in signature.parameters.items() if name != 'self'}

    @wraps(call)
    def checking(*args: P.args, **kwargs: P.kwargs) -> Result:
        bound = signature.bind(*args, **kwargs)
        bound.apply_defaults()
        for name, value in bound.arguments.items():
            if name in hints and not _fits(value, hints[name]):
                kind = type(value).__name__
                raise InputError(f'{name} is of type {kind}: give {_words(hints[name])}')
            _check(name, value, **options.get(name, {}))
        try:
            return call(*bound.args, **bound.kwargs)
        except EndoscopeError as error:
            error.args = (_FOLDER.sub('', str(error)),)
            raise

    return checking


def takes(options: Any, types: Mapping[str, Any]) -> Callable[[Callable[..., Any]], Any]:
    """Give a call with `**options` the fields of a dataclass as keywords, some of other types."""

    def taking(call: Any) -> Any:
        signature, lines = inspect.signature(call), []
        *own, _ = signature.parameters.values()
        for each in fields(options):
            hint = types.get(each.name, each.type)
            own.append(own[-1].replace(name=each.name, default=each.default, annotation=hint))
            lines.append(f'{each.name} : {_words(hint)}\n        {each.metadata["help"]}')
        call.__signature__ = signature.replace(parameters=own)
        call.__doc__ = call.__doc__.replace(_OPTIONS, '\n    '.join(lines))
        return checked(call, {each.name: each.metadata for each in fields(options)})

    return taking


def _check(name: str, value: Any, *, ends: Any = None, choices: Any = None, **_: Any) -> None:
    if ends and not ends[0] <= value <= ends[1]:
        raise InputError(f'{name} is {value!r}: give {ends[0]:g} to {ends[1]:g}')
    for one in value if choices else ():
        if one not in choices:
            raise InputError(f'{name} {one!r}: {nearest(one, choices)}')


def _fits(value: Any, hint: Any) -> bool:
    of, inside = get_origin(hint) or hint, get_args(hint)
    if of in (Union, UnionType):
        return any(_fits(value, one) for one in inside)
    if of is Callable:
        return callable(value)
    if of is Any or not isinstance(value, _NUMBERS.get(of, of)):
        return of is Any
    if not inside:
        return True
    # A word is no collection of words; of a mapping the names alone are looked at.
    return not isinstance(value, str) and all(_fits(one, inside[0]) for one in iter(value))


def _words(hint: Any) -> str:
    of, inside = get_origin(hint) or hint, get_args(hint)
    if of in (Union, UnionType):
        return ' or '.join(_words(one) for one in inside if one is not NoneType)
    items = inside and of is not Callable
    return f'{of.__name__} of {_words(inside[0])}' if items else str(of.__name__)
