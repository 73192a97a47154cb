"""Files that somebody writes, read as dataclasses whose types say what each key may be.

A field is a bool, int, float, str, `Literal`, another dataclass, `Mapping[str, X]`, `tuple[X, ...]`
or one of these or None; `Annotated` holds its bounds. A default stands for a key that is left out,
and for a section without content. `__post_init__` raises a ValueError where fields do not go
together. The error is always one `FileError`: file, key, what was given, what to give. YAML that is
ambiguous or boundless is refused by line.
"""

import math
import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import yaml

from endoscope_core.errors import FileError, nearest

LARGEST = 1 << 20
"""Bytes of a text. The largest honest file is a `metadata.yaml`: 300 topics of 2 kB each with their
quality of service, and 2000 files of 200 B each, make 1 MB."""
DEEPEST = 16
"""Levels of nesting; a `metadata.yaml` has seven."""
LONGEST_NUMBER = 64
"""Characters of a number or date; 17 digits, sign, point and exponent hold every double."""
_COUNTED = tuple(f'tag:yaml.org,2002:{kind}' for kind in ('int', 'float', 'timestamp'))
_MERGE = 'tag:yaml.org,2002:merge'
_WORDS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}
_LONGEST = 200


def load_yaml(path: str | Path) -> Any:
    """Content of a UTF-8 YAML file; FileError, naming file and line, if `parse_yaml` refuses it."""
    try:
        with Path(path).open('rb') as file:
            text = file.read(LARGEST + 1).decode()
    except OSError as error:
        raise FileError(f'cannot read {path}: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise FileError(f'{path} is not YAML: {error.reason} at byte {error.start}') from error
    return parse_yaml(text, str(path))


def parse_yaml(text: str, name: str) -> Any:
    """Content of a YAML text: mappings with unique keys, lists, texts, numbers, dates, nothing.

    FileError, with `name` and the line, where it is no YAML, larger than `LARGEST`, deeper than
    `DEEPEST`, has a key twice, an alias (of which a few lines can make gigabytes), a merge key, a
    tag, or a number that is none.
    """
    if len(text) > LARGEST:
        raise FileError(f'{name} is larger than {LARGEST >> 20} MiB: no file of this kind is')
    try:
        _check_events(text)
        return yaml.load(text, Loader=_StrictLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f'line {mark.line + 1}: ' if mark else ''
        raise FileError(f'{name} is not YAML: {where}{error.problem or error.context}') from error
    except yaml.YAMLError as error:
        raise FileError(f'{name} is not YAML: {" ".join(str(error).split())}') from error


def _check_events(text: str) -> None:
    """Refuse depth, aliases and tags while nothing is built yet, since building recurses."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        if isinstance(event, yaml.AliasEvent):
            raise _marked(event, f'*{event.anchor} refers to another place: write it out')
        tag = getattr(event, 'tag', None)
        if tag not in (None, '!'):
            raise _marked(event, f'a type is given ({tag}): leave it out')
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > DEEPEST:
            raise _marked(event, f'nested deeper than {DEEPEST} levels')


class _StrictLoader(yaml.CSafeLoader):
    """A safe loader that takes no key twice and no number that python does not."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        if node.tag == _MERGE:
            raise _marked(node, 'a merge key (<<): write the keys out')
        if node.tag in _COUNTED and len(node.value) > LONGEST_NUMBER:
            raise _marked(node, f'a number of {len(node.value)} characters')
        try:
            return super().construct_object(node, deep)
        except (ValueError, OverflowError) as error:
            raise _marked(node, str(error)) from error

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        content: dict[Hashable, Any] = {}
        for key_node, value_node in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, Hashable):
                raise _marked(key_node, 'a list or mapping as a key')
            if key in content:
                raise _marked(key_node, f'key {key!r} is given twice')
            content[key] = self.construct_object(value_node, deep)
        return content


def _marked(place: yaml.Node | yaml.Event, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=place.start_mark)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Before:
    """In `Annotated`: turns what may be written as well into the value, before that is checked."""

    change: Callable[[Any], Any]


def within(low: float, high: float | None = None, unit: str = '') -> msgspec.Meta:
    """In `Annotated`: bounds, both inclusive, of an int where `low` is one, and else of a float.

    Without `high`, infinity is a number too.
    """
    first, last = (f'{end:g}' if isinstance(end, float) else end for end in (low, high))
    ends = f'{first} on' if high is None else f'{first} to {last}'
    wanted = f'{_WORDS[type(low)]} from {ends} {unit}'.rstrip()
    return msgspec.Meta(ge=low, le=high, description=wanted)


def one_of(choices: Iterable[str]) -> msgspec.Meta:
    """In `Annotated`: the texts that are valid."""
    listed = tuple(choices)
    pattern = rf'^(?:{"|".join(map(re.escape, listed))})\Z'
    return msgspec.Meta(pattern=pattern, description=f'one of {", ".join(listed)}')


def _as_number(value: Any) -> Any:
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


Number = Annotated[float, Before(_as_number)]
"""A number that may be given as text, as YAML 1.1 takes 1e-4 (no dot)."""


def load[T](kind: type[T], path: str | Path, what: str) -> T:
    """Read a YAML file, called `what` in messages, as a dataclass; FileError if it is none."""
    try:
        content = load_yaml(path)
    except FileError as error:
        raise FileError(f'{what}: {error}') from error
    return read(kind, content, f'{what} {path}')


def read[T](kind: type[T], content: Any, where: str, key: str = '') -> T:
    """The content of the file `where`, or of one of its keys, as a dataclass, or a FileError."""
    if content is None:
        raise _refused(kind, content, where, key)
    made: T = _read(kind, content, where, key)
    return made


@contextmanager
def blamed_on(where: str) -> Iterator[None]:
    """Make a ValueError a FileError about `where`."""
    try:
        yield
    except FileError:
        raise
    except ValueError as error:
        raise FileError(f'{where}: {error}') from error


def _read(kind: Any, value: Any, where: str, key: str) -> Any:
    plain, *notes = get_args(kind) if get_origin(kind) is Annotated else (kind,)
    origin = get_origin(plain)
    for note in notes:
        if isinstance(note, Before):
            value = note.change(value)
    if origin in (Union, UnionType) and NoneType in get_args(plain):
        some = [arm for arm in get_args(plain) if arm is not NoneType]
        return None if value is None else _read(Union[*some], value, where, key)
    if is_dataclass(plain):
        return _record(plain, {} if value is None else value, where, key)
    if origin is Mapping:
        return _mapping(kind, get_args(plain), value, where, key)
    if origin is tuple:
        return _list(kind, get_args(plain), value, where, key)
    if plain is Any:
        return value
    try:
        made = msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise _refused(kind, value, where, key) from error
    bounded = any(isinstance(note, msgspec.Meta) for note in notes)
    if isinstance(made, float) and not math.isfinite(made) and not bounded:
        raise FileError(f'{_at(where, key)} is {made}: give a finite number')
    return made


def _record(kind: Any, value: Any, where: str, key: str) -> Any:
    if not isinstance(value, Mapping):
        raise _refused(kind, value, where, key)
    types = get_type_hints(kind, include_extras=True)
    known = {f.name: f.default is MISSING and f.default_factory is MISSING for f in fields(kind)}
    _check_keys(value, known, where, key)
    given = {}
    for name, required in known.items():
        here = f'{key}.{name}' if key else name
        if required and name not in value:
            raise FileError(f'{where}: {here} is missing: give {_wanted(types[name])}')
        if required or value.get(name) is not None or (name in value and not _parts(types[name])):
            given[name] = _read(types[name], value[name], where, here)
    with blamed_on(_at(where, key)):
        return kind(**given)


def _mapping(kind: Any, parts: tuple[Any, Any], value: Any, where: str, key: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise _refused(kind, value, where, key)
    if get_origin(parts[0]) is Literal:
        _check_keys(value, get_args(parts[0]), where, key)
    for name in value:
        if not isinstance(name, str):
            raise FileError(f'{_at(where, key)}: key {_short(name)} is no name: put it in quotes')
    return {name: _read(parts[1], item, where, f'{key}.{name}') for name, item in value.items()}


def _list(kind: Any, parts: tuple[Any, ...], value: Any, where: str, key: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise _refused(kind, value, where, key)
    if parts[-1] is Ellipsis:
        parts = (parts[0],) * len(value)
    if len(parts) != len(value):
        raise _refused(kind, value, where, key)
    items = enumerate(zip(parts, value, strict=True))
    return tuple(_read(part, item, where, f'{key}[{i}]') for i, (part, item) in items)


def _check_keys(given: Mapping[Any, Any], known: Iterable[str], where: str, key: str) -> None:
    for name in given:
        if name not in known:
            hint = nearest(str(name), known)
            raise FileError(f'{_at(where, key)}: unknown key {_short(str(name), str)}: {hint}')


def _parts(kind: Any) -> bool:
    """Whether a value of this kind has values in it."""
    plain = get_args(kind)[0] if get_origin(kind) is Annotated else kind
    return is_dataclass(plain) or get_origin(plain) in (Mapping, tuple)


def _wanted(kind: Any) -> str:
    plain, *notes = get_args(kind) if get_origin(kind) is Annotated else (kind,)
    for note in notes:
        if isinstance(note, msgspec.Meta) and note.description:
            return note.description
    parts = get_args(plain)
    if is_dataclass(plain):
        return f'a mapping with {", ".join(f.name for f in fields(plain))}'
    if get_origin(plain) is Literal:
        return f'{"one of " if len(parts) > 1 else ""}{", ".join(map(str, parts))}'
    if get_origin(plain) is Mapping:
        return 'a mapping of names to values'
    if get_origin(plain) is tuple:
        return 'a list' if parts[-1] is Ellipsis else f'a list of {len(parts)}'
    return _WORDS[plain]


def _refused(kind: Any, value: Any, where: str, key: str) -> FileError:
    return FileError(f'{_at(where, key)} is {_short(value)}: give {_wanted(kind)}')


def _at(where: str, key: str) -> str:
    return f'{where}: {key}' if key else where


def _short(value: Any, text: Callable[[Any], str] = repr) -> str:
    shown = text(value)
    return shown if len(shown) <= _LONGEST else f'{shown[:_LONGEST]} ...'
