"""Writes into the pages what code and records say: `make -C ros_ws reference`.

A page keeps what is made for it between two comments, of which the first names the part, or the
table and the records that it is made from (`record_tables.py`). Nothing in a part depends on the
terminal, the day or the place of the checkout.
"""

import argparse
import ast
import dataclasses
import importlib
import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any

import record_tables
import yaml

from endoscope_bags.table_mapping import EXAMPLE
from endoscope_bringup.cli import build_parser
from endoscope_core.physics import EffectSpec, JointParameters, PlantDescription, SensorParameters
from endoscope_core.physics.description import NUMBERS
from endoscope_core.physics.effect import Parameter
from endoscope_core.physics.effects import KNOWN
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.plant_file import plant_to_mapping
from endoscope_explain.report.writing import KEYS
from endoscope_nodes import program
from endoscope_nodes.names import CLOCK_NODE
from endoscope_nodes.runtime.node_parameters import OF_NODE, OF_PROCESS
from endoscope_nodes.runtime.parameters import Described, as_typed, described
from endoscope_nodes.services import SERVICES, TRIGGER
from endoscope_nodes.topics import RECORDED, TOPICS, GraphTopic, Qos

_HERE = Path(__file__).parent
PAGES = (*sorted(_HERE.rglob('*.md')), _HERE.with_name('security') / 'policy.xml')
WIDTH = 100
"""Columns of a command's usage, whatever the terminal has."""

CORE = (
    *('physics', 'signals', 'hysteresis', 'control', 'calibration', 'identification'),
    *('metrics', 'kinematics', 'safety'),
)
OF_EVERY_NODE = (
    *('describe_parameters', 'get_parameter_types', 'get_parameters', 'list_parameters'),
    *('set_parameters', 'set_parameters_atomically', 'get_type_description'),
)
"""Services that ROS gives every node."""
DEVICES = ('dynamixel', 'load_cells', 'em_tracker')
_INDENTED = re.compile(r'^(?: {4}.*\n)+', re.M)
_PART = re.compile(
    r'^(<!-- made from the (?:code|records): )(\S+) -->\n.*?(?=^<!-- end -->$)',
    re.M | re.S,
)


def _table(heading: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    """Yield a table, in which a bar within a cell is one."""
    cells = [list(heading), *(list(row) for row in rows)]
    cells.insert(1, ['---'] * len(cells[0]))
    yield ''
    for row in cells:
        yield '| ' + ' | '.join(' '.join(cell.split()).replace('|', r'\|') for cell in row) + ' |'
    yield ''


class _Usage(argparse.HelpFormatter):
    """Folds at one width, whatever COLUMNS says."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=WIDTH)


def _names(names: Iterable[str]) -> str:
    return ', '.join(f'`{name}`' if ' ' not in name else name for name in names)


def _commands() -> Iterator[str]:
    """Every subcommand of `endoscope`, from its parser."""
    yield from _subcommands(build_parser(), 2)


def _subcommands(parser: argparse.ArgumentParser, level: int) -> Iterator[str]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, subparser in action.choices.items():
                yield from _command(name, subparser, _help_of(action, name), level)


def _help_of(action: argparse._SubParsersAction, name: str) -> str:
    return next((c.help or '' for c in action._choices_actions if c.dest == name), '')


def _command(name: str, parser: argparse.ArgumentParser, summary: str, level: int) -> Iterator[str]:
    title = parser.prog if level == 2 else name
    yield from ('', f'{"#" * level} {title}', '')
    described_as = parser.description or f'{summary[:1].upper()}{summary[1:]}.'
    yield _INDENTED.sub(lambda lines: f'```text\n{dedent(lines[0])}```\n', f'{described_as}\n')
    yield from ('', '```text')
    parser.formatter_class = _Usage
    yield from (line[len('usage: ') :] for line in parser.format_usage().splitlines())
    yield '```'
    rows = [
        (_spelling(action), (action.help or '') % _words(action, parser))
        for action in parser._actions
        if not isinstance(action, argparse._HelpAction | argparse._SubParsersAction)
        and action.help is not argparse.SUPPRESS
    ]
    if rows:
        yield from _table(('argument', 'meaning'), rows)
    yield from _subcommands(parser, level + 1)


def _words(action: argparse.Action, parser: argparse.ArgumentParser) -> dict[str, Any]:
    return {**vars(action), 'prog': parser.prog}


def _spelling(action: argparse.Action) -> str:
    if not action.option_strings:
        return f'`{action.metavar or action.dest}`'
    if action.nargs == 0:
        return _names(action.option_strings)
    choices = '{' + ','.join(map(str, action.choices or ())) + '}'
    value = action.metavar or (choices if action.choices else action.dest.upper())
    return ', '.join(f'`{option} {value}`' for option in action.option_strings)


def _nodes() -> Iterator[str]:
    """What each node hears, says and serves, from the table of topics."""
    for name, started in program.PROGRAMS.items():
        yield from ('', f'## {started.name}', '', started.purpose)
        if name != started.name:
            yield from ('', f'Node name `{name}`.')
        heard = [topic.name for topic in TOPICS if name in topic.heard_by]
        said = [topic.name for topic in TOPICS if name in topic.said_by]
        served = [service.name for service in SERVICES if service.served_by == name]
        rows = [('subscribes', heard), ('publishes', said), ('serves', served)]
        if name == 'recorder':
            rows[0] = ('subscribes', [topic.name for topic in TOPICS if topic.recorded])
        yield from _table(('', ''), [(what, _names(names)) for what, names in rows if names])


def _topics() -> Iterator[str]:
    """Every topic and service of the interface."""
    yield from ('', '## What they carry')
    yield from _table(
        ('topic', 'type', 'rate', 'content'),
        [(f'`{t.name}`', f'`{t.type}`', t.rate, t.content) for t in TOPICS],
    )
    yield from ('', '## Who speaks to whom')
    yield from _table(
        ('topic', 'published by', 'subscribed by', 'recorded', 'QoS offered', 'QoS asked'),
        [_speakers(topic) for topic in TOPICS],
    )
    yield from ('', '## Services', '', f'All are `{TRIGGER}`.')
    yield from _table(
        ('service', 'node', 'what it does'),
        [(f'`{s.name}`', f'`{s.served_by}`', s.purpose) for s in SERVICES],
    )


def _speakers(topic: GraphTopic) -> tuple[str, ...]:
    return (
        f'`{topic.name}`',
        _names(topic.said_by) or 'an outside program',
        _names(topic.heard_by),
        'yes' if topic.recorded else '',
        _qos(topic.offered),
        _qos(topic.asked),
    )


def _qos(qos: Qos | None) -> str:
    return '' if qos is None else str(qos)


def _policy() -> Iterator[str]:
    """What each node of the graph may do (SROS2): what the table of topics says that it does."""
    for node in program.graph.nodes:
        if node == CLOCK_NODE:
            continue
        who = {node, 'every node'}
        said = [topic.name for topic in TOPICS if who & set(topic.said_by)]
        heard = [topic.name for topic in TOPICS if who & set(topic.heard_by)]
        if node == 'recorder':
            heard += RECORDED
        own = [service.name for service in SERVICES if service.served_by == node]
        yield f'    <enclave path="/endoscope/{node}">'
        yield '      <profiles>'
        yield f'        <profile ns="/endoscope" node="{node}">'
        for verb, kind, names in (
            ('publish', 'topic', sorted({*said, '/parameter_events', '/rosout'})),
            ('subscribe', 'topic', sorted({*heard, '/parameter_events'})),
            ('reply', 'service', [*(f'{node}/{name}' for name in OF_EVERY_NODE), *own]),
        ):
            yield f'          <{kind}s {verb}="ALLOW">'
            yield from (f'            <{kind}>{name}</{kind}>' for name in names)
            yield f'          </{kind}s>'
        yield from ('        </profile>', '      </profiles>', '    </enclave>')


def _parameters() -> Iterator[str]:
    """The parameters of each node, and of a process."""
    for title, kinds in (('Of every process', OF_PROCESS), *OF_NODE.items()):
        if kinds:
            yield from ('', f'## {title}')
            yield from _table(
                ('parameter', 'default', 'allowed', 'unit', 'live', 'what it does'),
                [_parameter(one) for kind in kinds for one in described(kind)],
            )


def _parameter(one: Described) -> tuple[str, ...]:
    every = one.default == as_typed(RECORDED)
    return (
        f'`{one.name}`',
        'all that are recorded' if every else f'`{one.default}`',
        one.allowed,
        one.unit,
        'yes' if one.dynamic else '',
        one.description,
    )


def _nominal_plant() -> Iterator[str]:
    """A complete plant.yaml of the nominal plant."""
    plant = PlantDescription(effects=(EffectSpec('stribeck_friction', 'bend_x', {'rise': 0.5}),))
    content = plant_to_mapping(plant)
    yield '```yaml'
    yield from yaml.safe_dump(content, sort_keys=False, default_flow_style=False).splitlines()
    yield '```'


def _plant_keys() -> Iterator[str]:
    """Bounds and units of every key of a plant.yaml."""
    for title, kind in (('joints', JointParameters), ('sensors', SensorParameters)):
        yield from ('', f'## {title}')
        yield from _table(('key', 'nominal', 'allowed', 'unit', 'meaning'), _keys(kind))
        yield f'Forms and limits: [{kind.__name__}](api_core.md#endoscope_corephysics).'


def _keys(kind: type) -> Iterator[tuple[str, ...]]:
    for key in dataclasses.fields(kind):
        known = NUMBERS[key.name]
        yield (
            f'`{key.name}`',
            f'`{as_typed(key.default)}`',
            _range(known.low, known.high),
            known.unit,
            known.meaning,
        )


def _mapping() -> Iterator[str]:
    """A mapping file with every key."""
    yield from ('```yaml', *EXAMPLE.splitlines(), '```')


def _report() -> Iterator[str]:
    """The keys of report.json."""
    yield from _table(('key', 'content'), [(f'`{key}`', what) for key, what in KEYS.items()])


def _switch(parameter: Parameter) -> str:
    return ', '.join(f'{_number(v)}: {parameter.in_words(v)}' for v in parameter.admissible)


def _effects() -> Iterator[str]:
    """The catalogue of effects, and the physics of the nominal plant."""
    for effect in KNOWN.values():
        yield from (
            '',
            f'## {effect.id}',
            '',
            f'*{effect.stage.capitalize()}.* {effect.physics}',
        )
        yield from ('', '```text', effect.equation, '```', '', f'Source: {effect.source}.')
        yield from _table(
            ('parameter', 'allowed', 'unit', 'typical', 'off'),
            [
                (
                    f'`{p.name}`',
                    _switch(p) if p.is_switch else _range(p.low, p.high),
                    p.unit,
                    _number(p.typical),
                    '' if math.isnan(p.off) else _number(p.off),
                )
                for p in effect.parameters
            ],
        )


def _places() -> Iterator[str]:
    """The places for functions that the catalogue does not have."""
    yield from _table(
        ('place', 'stage', 'what it is', 'symbol', 'range', 'unit', 'within'),
        [
            (
                f'`{place.id}`',
                place.stage,
                place.physics if place.shape == 'any' else f'{place.physics} {place.shape}',
                f'`{place.argument.symbol}`',
                f'{_range(place.argument.low, place.argument.high)} {place.argument.unit}',
                place.unit,
                f'+-{_number(place.largest)}',
            )
            for place in FUNCTIONS.values()
        ],
    )


def _modules(package: str, *modules: str) -> Iterator[str]:
    for name in modules:
        yield from ('', f'## {package}.{name}')
        yield from _module(f'{package}.{name}')


def _module(name: str) -> Iterator[str]:
    """Yield a table of what a module exports, and let autodoc write the rest on the site."""
    module = importlib.import_module(name)
    exported = sorted(getattr(module, '__all__', ()))
    if exported:
        yield from _table(
            ('name', 'what it is'),
            [(f'`{one}`', _first_paragraph(_docstring(module, one))) for one in exported],
        )
    yield from ('', '```{eval-rst}', f'.. automodule:: {name}', '   :members:', '```')


def _docstring(module: ModuleType, name: str) -> str:
    value = getattr(module, name)
    if inspect.isclass(value) or inspect.isroutine(value):
        return inspect.getdoc(value) or ''
    # A constant has its docstring below it, in the module that assigns it.
    tree = ast.parse(inspect.getsource(module))
    for node, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(node, ast.ImportFrom) and name in [alias.name for alias in node.names]:
            return _docstring(importlib.import_module(node.module or ''), name)
        if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(after, ast.Expr):
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            if isinstance(target, ast.Name) and target.id == name:
                return str(ast.literal_eval(after.value))
    return ''


def _first_paragraph(text: str) -> str:
    return ' '.join(text.split('\n\n', maxsplit=1)[0].split())


def _range(low: float, high: float) -> str:
    return f'{_number(low)} to {_number(high)}'


def _number(value: float) -> str:
    return f'{value:.6g}'


PARTS: dict[str, Callable[[], Iterator[str]]] = {
    'commands': _commands,
    'nodes': _nodes,
    'topics': _topics,
    'parameters': _parameters,
    'policy': _policy,
    'nominal-plant': _nominal_plant,
    'plant-keys': _plant_keys,
    'effects': _effects,
    'places': _places,
    'mapping': _mapping,
    'report': _report,
    'api-core': lambda: _modules('endoscope_core', *CORE),
    'api-bags': lambda: _module('endoscope_bags'),
    'api-devices': lambda: _modules('endoscope_devices', *DEVICES),
    'api-explain': lambda: _module('endoscope_explain'),
}


def with_current_parts(page: str) -> str:
    """Return the text of a page with its parts as the code has them now."""
    return _PART.sub(lambda part: f'{part[1]}{part[2]} -->\n\n{_text(_made(part[2]))}\n\n', page)


def _made(part: str) -> Iterator[str]:
    """Yield a part by its name, or a table of records: `answers:NAME,NAME` or `table:NAME`."""
    kind, _, names = part.partition(':')
    if not names:
        return PARTS[part]()
    rows = record_tables.TABLES[kind](*names.split(','))
    return _table(next(rows), rows)


def _text(lines: Iterator[str]) -> str:
    return re.sub(r'\n{3,}', '\n\n', '\n'.join(lines)).strip('\n')


if __name__ == '__main__':
    for path in PAGES:
        path.write_text(with_current_parts(path.read_text(encoding='utf-8')), encoding='utf-8')
