"""Which nodes the parameters on a command line and in its files are for.

rcl gives a node what is addressed to it and drops the rest without a word, so that a misspelt name
of a node leaves it with its defaults.  What rcl understands: ``-p NODE:NAME:=VALUE`` with a node in
no namespace, and in files ``/NAMESPACE/NODE``, nested or not, where ``*`` stands for one name and
``**`` for any number of them (rcl_yaml_param_parser, and the matching of rclcpp and rclpy).
"""

import difflib
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import yaml

from endoscope_nodes.runtime.node_parameters import OF_NODE
from endoscope_nodes.runtime.parameters import ParameterError

_PARAMETERS = 'ros__parameters'
_ANY = ('*', '**')


def check_sections(args: Sequence[str], namespace: str) -> list[str]:
    """Refuse parameters for nodes that there cannot be; a line for each section of another rig."""
    # A file may serve several processes and rigs, so that a section need not be for a node of this
    # process, but for one of this project.
    renamed = [rule.partition('__node:=')[2] for rule in _values_of(args, ('-r', '--remap'))]
    known = sorted({*OF_NODE, *renamed} - {''})
    for rule in _values_of(args, ('-p', '--param')):
        node, colon, _ = rule.partition(':=')[0].partition(':')
        if colon:
            _check(f"'-p {rule}'", f'/{node}', known, namespace)
    told = []
    for file in _values_of(args, ('--params-file',)):
        for section in _sections(file):
            if not _check(f"{file}: section '{section}'", section, known, namespace):
                told.append(f"{file}: section '{section}' is for no node in {namespace}")
    return told


def _values_of(args: Sequence[str], options: Sequence[str]) -> list[str]:
    return [value for option, value in pairwise(args) if option in options]


def _check(where: str, section: str, known: Sequence[str], namespace: str) -> bool:
    """Tell whether a section is for a node in this namespace, if there can be such a node."""
    above, _, node = section.rpartition('/')
    if node not in (*_ANY, *known):
        near = difflib.get_close_matches(node, known, 1)
        hint = f"did you mean '{near[0]}'?" if near else f'there are {", ".join(known)}'
        raise ParameterError(f"{where}: there is no node '{node}'; {hint}")
    here = namespace.rstrip('/')
    if here and not above and node not in _ANY:
        raise ParameterError(
            f'{where} is for a node without a namespace, and here they are in {here}; write '
            f"'{here}/{node}' or '/**/{node}' in a parameters file"
        )
    pattern = re.sub(r'/\*\*?', lambda m: r'(/\w+)*' if m[0] == '/**' else r'/\w+', section)
    return any(re.fullmatch(pattern, f'{here}/{name}') for name in known)


def _sections(file: str) -> Iterator[str]:
    # Composed, not loaded: a mapping in Python would hide what is there twice.
    root = yaml.compose(Path(file).read_text(encoding='utf-8-sig'))
    if isinstance(root, yaml.MappingNode):
        yield from _below(file, '', root)


def _below(file: str, above: str, mapping: yaml.MappingNode) -> Iterator[str]:
    for key, value in mapping.value:
        if key.value == _PARAMETERS:
            _check_unique(f"{file}: section '{above}'", value)
            yield above
        elif isinstance(value, yaml.MappingNode):
            yield from _below(file, f'{above}/{key.value.strip("/")}', value)


def _check_unique(where: str, parameters: yaml.Node) -> None:
    if not isinstance(parameters, yaml.MappingNode):
        return
    names = [key.value for key, _ in parameters.value]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise ParameterError(f"{where} has the parameter '{twice[0]}' twice")
    for key, value in parameters.value:
        _check_unique(f"{where}, '{key.value}'", value)
