"""What ``NODE --help`` prints: purpose, topics, services and every parameter of a node."""

import textwrap
from collections.abc import Iterator, Sequence

from endoscope_nodes.runtime.node_parameters import OF_NODE, OF_PROCESS
from endoscope_nodes.runtime.parameters import Described, described
from endoscope_nodes.services import SERVICES
from endoscope_nodes.topics import TOPICS

_WIDTH = 100
_USAGE = """\
usage: {name} {options}[--ros-args [-p PARAMETER:=VALUE ...] [--params-file FILE ...]
       {blank} [-r __ns:=/NAMESPACE] [-r OLD:=NEW ...] [--log-level LEVEL]]

{purpose}
"""
_TO_ONE_OF_MANY = """\
A parameter behind -p goes to every node that has it. For one node alone, give --params-file a file
such as

    /**/master:
      ros__parameters: {source: master}
"""
_END = """\
What is unknown, misspelt or out of range is refused. A parameter marked * may be changed while the
node runs: endoscope operate set NODE.PARAMETER VALUE.

SIGINT, SIGTERM and SIGHUP stop it. Exit status: 0, or 1 where a recording is incomplete or a replay
was refused, 2 for arguments or parameters that it does not start with, 128 + the signal's number
where it was stopped before it had started."""


def help_of(
    name: str, purpose: str, nodes: Sequence[str], options: Sequence[tuple[str, str]] = ()
) -> str:
    """Return the help of a program; `options` are its own words, and what each does."""
    words = ''.join(f'[{word}] ' for word, _ in options)
    blank = ' ' * len(f'{name} {words}')
    text = textwrap.fill(purpose, _WIDTH)
    parts = [_USAGE.format(name=name, options=words, blank=blank[:-1], purpose=text)]
    if options:
        parts.append(
            ''.join(_wrapped(does, f'{word:<14}', ' ' * 14) + '\n' for word, does in options)
        )
    if len(nodes) > 1:
        parts += [_wrapped(f'{", ".join(nodes)}.', 'Nodes: ', ' ' * 7) + '\n', _TO_ONE_OF_MANY]
    else:
        parts.append(''.join(f'{line}\n' for line in _interface(nodes[0])))
    parts += [_section(node, OF_NODE[node]) for node in nodes if OF_NODE[node]]
    parts.append(_section('of the whole process', OF_PROCESS))
    return '\n'.join([*parts, _END])


def _interface(node: str) -> Iterator[str]:
    for does, found in (
        ('hears', [topic.name for topic in TOPICS if node in topic.heard_by]),
        ('says', [topic.name for topic in TOPICS if node in topic.said_by]),
        ('serves', [service.name for service in SERVICES if node == service.served_by]),
    ):
        if found:
            yield _wrapped(', '.join(found), f'{does:<7}', ' ' * 7)


def _section(title: str, kinds: Sequence[type]) -> str:
    lines = [f'{title}:']
    for kind in kinds:
        for parameter in described(kind):
            lines += _entry(parameter)
    return '\n'.join(lines) + '\n'


def _entry(parameter: Described) -> Iterator[str]:
    mark = '*' if parameter.dynamic else ' '
    # An empty text stands in quotes for the shell.
    yield _wrapped(f'{parameter.name}:={parameter.default}', f'{mark} -p ', ' ' * 10)
    allowed = f'{parameter.allowed or "in"} {parameter.unit}'.strip() if parameter.unit else ''
    parts = [parameter.description, allowed or parameter.allowed]
    yield _wrapped('; '.join(filter(None, parts)), ' ' * 10, ' ' * 10)


def _wrapped(text: str, first: str, others: str) -> str:
    return textwrap.fill(
        text, _WIDTH, initial_indent=first, subsequent_indent=others, break_on_hyphens=False
    )
