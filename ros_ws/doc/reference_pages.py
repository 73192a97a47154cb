"""Directives that write the reference pages from the code that they are about."""

import argparse
import dataclasses
import math
from collections.abc import Iterable, Iterator
from typing import Any

import yaml
from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from sphinx.application import Sphinx

from endoscope_bags.table_mapping import EXAMPLE
from endoscope_bringup.cli import build_parser
from endoscope_core.physics import EffectSpec, JointParameters, PlantDescription, SensorParameters
from endoscope_core.physics.effect import Parameter
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.plant_file import REACH, plant_to_mapping
from endoscope_nodes import program
from endoscope_nodes.node_parameters import OF_NODE, OF_PROCESS
from endoscope_nodes.parameters import Described, as_typed, described
from endoscope_nodes.topics import RECORDED, SERVICES, TOPICS, TRIGGER, Qos, Topic


class _Generated(Directive):
    """Puts the Markdown of `lines` in its place."""

    def lines(self) -> Iterator[str]:
        """Yield lines of Markdown."""
        raise NotImplementedError

    def run(self) -> list[nodes.Node]:
        """Parse the lines and return what they are."""
        parsed = nodes.Element()
        content = StringList(list(self.lines()), source=self.state_machine.document['source'])
        self.state.nested_parse(content, 0, parsed, match_titles=True)
        return parsed.children


def _table(heading: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    """Yield a table, in which a bar within a cell is one."""
    cells = [list(heading), *(list(row) for row in rows)]
    cells.insert(1, ['---'] * len(cells[0]))
    yield ''
    for row in cells:
        yield '| ' + ' | '.join(' '.join(cell.split()).replace('|', r'\|') for cell in row) + ' |'
    yield ''


def _names(names: Iterable[str]) -> str:
    return ', '.join(f'`{name}`' if ' ' not in name else name for name in names)


class Commands(_Generated):
    """Every subcommand of `endoscope`, from its parser."""

    def lines(self) -> Iterator[str]:
        """Yield a section for each command."""
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
    yield parser.description or f'{summary[:1].upper()}{summary[1:]}.'
    yield from ('', '```text')
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


class Nodes(_Generated):
    """What each node hears, says and serves, from the table of topics."""

    def lines(self) -> Iterator[str]:
        """Yield a section for each node."""
        for name in program.NODES:
            yield from ('', f'## {name}', '', getattr(program, name).purpose)
            heard = [topic.name for topic in TOPICS if name in topic.heard_by]
            said = [topic.name for topic in TOPICS if name in topic.said_by]
            served = [service.name for service in SERVICES if service.served_by == name]
            rows = [('subscribes', heard), ('publishes', said), ('serves', served)]
            if name == 'recorder':
                rows[0] = ('subscribes', [topic.name for topic in TOPICS if topic.recorded])
            yield from _table(('', ''), [(what, _names(names)) for what, names in rows if names])


class Topics(_Generated):
    """Every topic and service of the interface."""

    def lines(self) -> Iterator[str]:
        """Yield a table of topics, one of their QoS and one of services."""
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


def _speakers(topic: Topic) -> tuple[str, ...]:
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


class Parameters(_Generated):
    """The parameters of each node, and of a process."""

    def lines(self) -> Iterator[str]:
        """Yield a section for each node that has any."""
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


class NominalPlant(_Generated):
    """A complete plant.yaml of the nominal plant."""

    def lines(self) -> Iterator[str]:
        """Yield the file."""
        plant = PlantDescription(
            effects=(EffectSpec('stribeck_friction', 'bend_x', {'rise': 0.5}),)
        )
        content = plant_to_mapping(plant)
        yield '```yaml'
        yield from yaml.safe_dump(content, sort_keys=False, default_flow_style=False).splitlines()
        yield '```'


class PlantKeys(_Generated):
    """Bounds and units of every key of a plant.yaml."""

    def lines(self) -> Iterator[str]:
        """Yield a table for joints and one for sensors."""
        for title, kind in (('joints', JointParameters), ('sensors', SensorParameters)):
            yield from ('', f'## {title}')
            yield from _table(('key', 'nominal', 'allowed', 'unit'), _keys(kind))
            yield f'What each means: {{class}}`~endoscope_core.physics.{kind.__name__}`.'


def _keys(kind: type) -> Iterator[tuple[str, ...]]:
    for key in dataclasses.fields(kind):
        low, high, unit = REACH[key.name]
        yield f'`{key.name}`', f'`{as_typed(key.default)}`', _range(low, high), unit


class Mapping(_Generated):
    """A mapping file with every key."""

    def lines(self) -> Iterator[str]:
        """Yield the file."""
        yield from ('```yaml', *EXAMPLE.splitlines(), '```')


def _switch(parameter: Parameter) -> str:
    return ', '.join(f'{_number(v)}: {parameter.said(v)}' for v in parameter.admissible)


class Effects(_Generated):
    """The catalogue of effects."""

    def lines(self) -> Iterator[str]:
        """Yield a section for each effect."""
        for effect in CATALOGUE.values():
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


class Places(_Generated):
    """The places for functions that the catalogue does not have."""

    def lines(self) -> Iterator[str]:
        """Yield a table of them."""
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


class Modules(Directive):
    """The public names of a package, and of the modules of it that are named."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Let autodoc write each of them."""
        package = self.arguments[0]
        lines = ['```{eval-rst}']
        for name in self.content:
            module = package if name == '.' else f'{package}.{name}'
            lines += [] if name == '.' else [module, '-' * len(module), '']
            lines += [f'.. automodule:: {module}', '   :members:', '']
        parsed = nodes.Element()
        content = StringList([*lines, '```'], source=self.state_machine.document['source'])
        self.state.nested_parse(content, 0, parsed, match_titles=True)
        return parsed.children


def _range(low: float, high: float) -> str:
    return f'{_number(low)} to {_number(high)}'


def _number(value: float) -> str:
    return f'{value:.6g}'


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx of the directives."""
    for name, directive in (
        ('commands', Commands),
        ('nodes', Nodes),
        ('topics', Topics),
        ('parameters', Parameters),
        ('nominal-plant', NominalPlant),
        ('plant-keys', PlantKeys),
        ('mapping', Mapping),
        ('effects', Effects),
        ('places', Places),
        ('modules', Modules),
    ):
        app.add_directive(f'endoscope-{name}', directive)
    return {'parallel_read_safe': True}
