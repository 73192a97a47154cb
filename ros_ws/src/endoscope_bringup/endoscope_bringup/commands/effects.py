"""`endoscope effects`: the physics that a plant.yaml can add to the nominal plant."""

import argparse
import math
import textwrap
from typing import TYPE_CHECKING

from endoscope_bringup.subcommands import add_json_option, print_json

if TYPE_CHECKING:
    from endoscope_core.physics.effect import Effect, Parameter
    from endoscope_core.physics.functions.places import Place


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `effects`."""
    parser = subparsers.add_parser(
        'effects',
        help='list the physics that a plant.yaml can add to the nominal plant',
        description='Lists the catalogue and the places for functions outside it, or describes '
        'effects: equation, source and parameters.',
    )
    parser.add_argument('ids', nargs='*', metavar='ID', help='effects and places to describe')
    parser.add_argument(
        '--plant',
        action='store_true',
        help='print the nominal plant.yaml instead: every key with value, unit and meaning',
    )
    add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Print the catalogue, or the effects asked for; return 0."""
    from endoscope_core.errors import EndoscopeError
    from endoscope_core.physics.effects import CATALOGUE, KNOWN, NOMINAL_PHYSICS, describe
    from endoscope_core.physics.functions import FUNCTIONS

    if args.plant:
        if args.ids:
            raise EndoscopeError('--plant prints the nominal plant: it takes no effects')
        return _print_plant(args.json)
    chosen = [FUNCTIONS.get(each) or describe(each) for each in args.ids]
    if args.json:
        print_json(
            [
                _place_as_json(FUNCTIONS[each.id]) if each.id in FUNCTIONS else _as_json(each)
                for each in chosen or KNOWN.values()
            ]
        )
        return 0
    if chosen:
        texts = [
            _place_text(FUNCTIONS[each.id])
            if each.id in FUNCTIONS
            else '\n'.join([*_heading(each), *map(_parameter, each.parameters)])
            for each in chosen
        ]
        print('\n\n'.join(texts))
        return 0
    for definition in CATALOGUE.values():
        print(f'{definition.id:22} {definition.stage:13} {definition.physics}')
    print('\nOf the nominal plant, which a plant file may lack:')
    for definition in NOMINAL_PHYSICS.values():
        print(f'{definition.id:22} {definition.stage:13} {definition.physics}')
    print('\nPlaces for an unknown_term, a formula or values of one state:')
    for place in FUNCTIONS.values():
        argument = place.argument
        print(f'{place.id:27} {place.stage:13} {place.physics[:-1]} ({argument.symbol}).')
    return 0


def _print_plant(as_json: bool) -> int:
    from endoscope_core.physics import PlantDescription
    from endoscope_core.physics.plant_file import nominal_plant_text, plant_to_mapping

    if as_json:
        print_json(plant_to_mapping(PlantDescription()))
    else:
        print(nominal_plant_text(), end='')
    return 0


def _place_as_json(place: 'Place') -> dict[str, object]:
    argument = place.argument
    return {
        **{key: getattr(place, key) for key in ('id', 'stage', 'physics', 'equation', 'unit')},
        **{key: getattr(place, key) for key in ('largest', 'shape', 'source')},
        **{key: getattr(argument, key) for key in ('symbol', 'low', 'high')},
        'argument': argument.words,
        'argument_unit': argument.unit,
    }


def _as_json(definition: 'Effect') -> dict[str, object]:
    keys = ('id', 'stage', 'physics', 'equation', 'source')
    return {
        **{key: getattr(definition, key) for key in keys},
        'parameters': [
            {
                key: getattr(parameter, key)
                for key in (
                    'name',
                    'unit',
                    'low',
                    'high',
                    'typical',
                    'off',
                    'choices',
                    'counted',
                    'words',
                )
            }
            for parameter in definition.parameters
        ],
    }


def _heading(definition: 'Effect') -> list[str]:
    lines = [f'{definition.id} ({definition.stage})']
    for text in (definition.physics, definition.equation, definition.source):
        lines += textwrap.wrap(text, 96, initial_indent='  ', subsequent_indent='    ')
    return lines


def _place_text(place: 'Place') -> str:
    argument, unit = place.argument, '' if place.unit == '-' else f' {place.unit}'
    f = f'f({argument.symbol})'
    reach = f'{argument.low:g} to {argument.high:g} {argument.unit}'
    return '\n'.join(
        [
            *_heading(place),
            f'  {argument.symbol:18} {reach} where no range is given',
            f'  {f:18} within +-{place.largest:g}{unit}',
        ]
    )


def _parameter(parameter: 'Parameter') -> str:
    if parameter.is_switch:
        allowed = ', '.join(f'{v:g}: {parameter.in_words(v)}' for v in parameter.admissible)
    else:
        allowed = f'{parameter.low:g} to {parameter.high:g} {parameter.unit}'
    off = '' if math.isnan(parameter.off) else f', off at {parameter.off:g}'
    return f'  {parameter.name:18} {allowed}, typical {parameter.typical:g}{off}'
