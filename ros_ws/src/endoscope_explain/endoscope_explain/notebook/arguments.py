"""Arguments of a call, held to its signature."""

import inspect
import re
import tempfile
from collections.abc import Callable
from functools import wraps
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from endoscope_core.errors import EndoscopeError, InputError

SCRATCH = 'endoscope-arrays-'
"""What the name of a folder begins with that holds a recording only as long as its arrays live."""
_FOLDER = re.compile(rf'{re.escape(str(Path(tempfile.gettempdir()) / SCRATCH))}[^/]*/')
_NUMBERS = {int: Integral, float: Real}


def checked[**P, Result](call: Callable[P, Result]) -> Callable[P, Result]:
    """Refuse arguments of another type, in one line, and name no folder that nobody made."""
    signature = inspect.signature(call)
    hints = {name: one.annotation for name, one in signature.parameters.items() if name != 'self'}

    @wraps(call)
    def checking(*args: P.args, **kwargs: P.kwargs) -> Result:
        for name, value in signature.bind(*args, **kwargs).arguments.items():
            if name in hints and not _fits(value, hints[name]):
                kind = type(value).__name__
                raise InputError(f'{name} is of type {kind}: give {_words(hints[name])}')
        try:
            return call(*args, **kwargs)
        except EndoscopeError as error:
            error.args = (_FOLDER.sub('', str(error)),)
            raise

    return checking


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
