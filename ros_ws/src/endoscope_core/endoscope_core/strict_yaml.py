"""Reads YAML that somebody else wrote: what is ambiguous or boundless in it is refused by line."""

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from endoscope_core.errors import FileError

LARGEST = 1 << 20
"""Bytes of a text. The largest honest file is a `metadata.yaml`: 300 topics of 2 kB each with their
quality of service, and 2000 files of 200 B each, make 1 MB."""
DEEPEST = 16
"""Levels of nesting; a `metadata.yaml` has seven."""
LONGEST_NUMBER = 64
"""Characters of a number or date; 17 digits, sign, point and exponent hold every double."""
_COUNTED = tuple(f'tag:yaml.org,2002:{kind}' for kind in ('int', 'float', 'timestamp'))
_MERGE = 'tag:yaml.org,2002:merge'


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
            raise _at(event, f'*{event.anchor} refers to another place: write it out')
        tag = getattr(event, 'tag', None)
        if tag not in (None, '!'):
            raise _at(event, f'a type is given ({tag}): leave it out')
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > DEEPEST:
            raise _at(event, f'nested deeper than {DEEPEST} levels')


class _StrictLoader(yaml.CSafeLoader):
    """A safe loader that takes no key twice and no number that python does not."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        if node.tag == _MERGE:
            raise _at(node, 'a merge key (<<): write the keys out')
        if node.tag in _COUNTED and len(node.value) > LONGEST_NUMBER:
            raise _at(node, f'a number of {len(node.value)} characters')
        try:
            return super().construct_object(node, deep)
        except (ValueError, OverflowError) as error:
            raise _at(node, str(error)) from error

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        content: dict[Hashable, Any] = {}
        for key_node, value_node in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, Hashable):
                raise _at(key_node, 'a list or mapping as a key')
            if key in content:
                raise _at(key_node, f'key {key!r} is given twice')
            content[key] = self.construct_object(value_node, deep)
        return content


def _at(place: yaml.Node | yaml.Event, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=place.start_mark)  # type: ignore[arg-type]
