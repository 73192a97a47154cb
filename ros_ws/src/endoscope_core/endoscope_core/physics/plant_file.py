"""plant.yaml: reading and writing a plant description."""

import math
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import yaml

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import EndoscopeError, FileError, nearest
from endoscope_core.physics.description import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    SensorParameters,
    TermSpec,
)
from endoscope_core.physics.functions import FUNCTIONS, describe_place
from endoscope_core.physics.layout import PROFILE_TERMS
from endoscope_core.physics.packing import with_nominal_in_place
from endoscope_core.physics.plant_numbers import NUMBERS
from endoscope_core.physics.recording import recording_faults
from endoscope_core.strict_yaml import load_yaml

UNKNOWN_TERM = 'unknown_term'
"""Id of what is added to the plant and is no effect of the catalogue."""
JOINT_NAMES = ('bend_x', 'bend_y')


class PlantFileError(EndoscopeError, ValueError):
    """A plant file that cannot be read; the message names the file, the key and what to do."""


def load_plant(path: str | Path) -> PlantDescription:
    """Read a plant.yaml; missing keys take their nominal values.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    PlantDescription

    Raises
    ------
    PlantFileError
        If the file cannot be read, is not a plant, or has an unknown key or an invalid value.
    """
    path = Path(path)
    try:
        content = load_yaml(path)
    except FileError as error:
        raise PlantFileError(f'plant file: {error}') from error
    try:
        return plant_from_mapping({} if content is None else content)
    except ValueError as error:
        raise PlantFileError(f'{path}: {error}') from error


def plant_from_mapping(content: Any) -> PlantDescription:
    """Plant from a plant.yaml's content; a ValueError names a wrong key and the nearest one."""
    sections = _section(content, 'the plant')
    _check_keys(sections, ('joints', 'sensors', 'effects'), 'the plant')
    joints_given: Mapping[str, Any] = dict.fromkeys(JOINT_NAMES)
    if sections.get('joints') is not None:
        joints_given = _section(sections['joints'], 'joints')
    _check_keys(joints_given, JOINT_NAMES, 'joints')
    if not joints_given:
        raise ValueError('joints is empty: name bend_x, bend_y or both')
    joints = {
        name: JointParameters(**_numbers(joints_given[name], JointParameters, f'joints.{name}'))
        for name in JOINT_NAMES
        if name in joints_given
    }
    sensors = SensorParameters(**_numbers(sections.get('sensors'), SensorParameters, 'sensors'))
    listed = sections.get('effects') or []
    if not isinstance(listed, list):
        raise ValueError('effects must be a list')
    entries = [_entry(i, given) for i, given in enumerate(listed)]
    plant = PlantDescription(
        joints,
        sensors,
        tuple(entry for entry in entries if isinstance(entry, EffectSpec)),
        tuple(entry for entry in entries if isinstance(entry, TermSpec)),
    )
    plant = with_nominal_in_place(plant)
    recording_faults(plant)
    return plant


def plant_to_mapping(plant: PlantDescription) -> dict[str, Any]:
    """The content of the plant.yaml of a plant, with every key written out."""
    return {
        'joints': {
            name: asdict(joint) | {'friction_profile': list(joint.friction_profile)}
            for name, joint in plant.joints.items()
        },
        'sensors': asdict(plant.sensors),
        'effects': [
            {
                'id': spec.id,
                'joint': spec.joint,
                'parameters': {name: float(v) for name, v in spec.parameters.items()},
            }
            for spec in plant.effects
        ]
        + [_term_mapping(term) for term in plant.terms],
    }


def _term_mapping(term: TermSpec) -> dict[str, Any]:
    stage = str(describe_place(term.place).stage)
    mapping: dict[str, Any] = {'id': UNKNOWN_TERM, 'joint': term.joint, 'stage': stage}
    mapping['place'] = term.place
    if term.expression:
        mapping['expression'] = term.expression
    if term.values:
        mapping['values'] = [float(value) for value in term.values]
    if term.range is not None:
        mapping['range'] = [float(end) for end in term.range]
    if term.multiplies:
        mapping['multiplies'] = True
    if term.lag_s is not None:
        mapping['lag_s'] = float(term.lag_s)
    return mapping


def save_plant(plant: PlantDescription, path: str | Path) -> None:
    """Write a plant.yaml that `load_plant` reads back to an equal plant.

    Parameters
    ----------
    plant : PlantDescription
    path : str or Path

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    write_text(path, yaml.safe_dump(plant_to_mapping(plant), sort_keys=False))


def _section(value: Any, where: str) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise ValueError(f'{where} must be a mapping of names to values, not {value!r}')
    for key in value:
        if not isinstance(key, str):
            raise ValueError(f'unknown key {key!r} in {where}: keys are names')
    return value


def _check_keys(given: Mapping[str, Any], valid: tuple[str, ...], where: str) -> None:
    for key in given:
        if key not in valid:
            raise ValueError(f'unknown key {key} in {where}: {nearest(str(key), valid)}')


def _numbers(given: Any, kind: type, where: str) -> dict[str, Any]:
    section = _section(given, where)
    _check_keys(section, tuple(f.name for f in fields(kind)), where)
    return {key: _value(key, value, f'{where}.{key}') for key, value in section.items()}


def _value(key: str, value: Any, where: str) -> Any:
    if key != 'friction_profile':
        return _within_reach(key, value, where)
    if not isinstance(value, list) or len(value) > PROFILE_TERMS:
        raise ValueError(f'{where} is {value!r}: give a list of up to {PROFILE_TERMS} coefficients')
    return tuple(_within_reach(key, c, f'{where}[{i}]') for i, c in enumerate(value))


def _within_reach(key: str, value: Any, where: str) -> float:
    number = _number(value, where)
    known = NUMBERS[key]
    if known.endless and number == math.inf:
        number = known.high
    # NaN passes: the parameters themselves refuse it, with a better word.
    if number < known.low or number > known.high:
        reach = f'{known.low:g} to {known.high:g} {known.unit}'.rstrip()
        raise ValueError(f'{where} is {number:g}: give {reach}')
    return number


def _number(value: Any, where: str) -> float:
    # YAML 1.1 reads 1e-4 (no dot) as a string.
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            pass
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f'{where} is {value!r}: give a number')
    return float(value)


def _entry(index: int, given: Any) -> EffectSpec | TermSpec:
    where = f'effects[{index}]'
    section = _section(given, where)
    if section.get('id') == UNKNOWN_TERM:
        return _term(section, where)
    _check_keys(section, ('id', 'joint', 'parameters'), where)
    _check_names(section, ('id', 'joint'), where)
    parameters = _section(section.get('parameters'), f'{where}.parameters')
    return EffectSpec(
        section['id'],
        section['joint'],
        {key: _number(value, f'{where}.parameters.{key}') for key, value in parameters.items()},
    )


def _check_names(section: Mapping[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in keys:
        if not isinstance(section.get(key), str):
            raise ValueError(f'{where} has no {key}: give it as a name')


def _term(section: Mapping[str, Any], where: str) -> TermSpec:
    more = ('expression', 'values', 'range', 'multiplies', 'lag_s')
    _check_keys(section, ('id', 'joint', 'stage', 'place', *more), where)
    _check_names(section, ('joint', 'stage'), where)
    stages = {str(place.stage) for place in FUNCTIONS.values()}
    if section['stage'] not in stages:
        raise ValueError(
            f'{where}: unknown stage {section["stage"]}: {nearest(section["stage"], stages)}'
        )
    here = [name for name, place in FUNCTIONS.items() if place.stage == section['stage']]
    if not isinstance(section.get('place'), str):
        raise ValueError(f'{where} has no place: valid are {", ".join(here)}')
    if section['place'] in FUNCTIONS and section['place'] not in here:
        raise ValueError(
            f'{where}: {section["place"]} is a place of the stage '
            f'{FUNCTIONS[section["place"]].stage}, not {section["stage"]}'
        )
    if section['place'] not in here:
        raise ValueError(
            f'{where}: unknown place {section["place"]}: {nearest(section["place"], here)}'
        )
    # YAML reads the formula of a constant as a number.
    expression = section.get('expression', '')
    if not isinstance(expression, str):
        expression = str(_number(expression, f'{where}.expression'))
    ends = section.get('range')
    if ends is not None and (not isinstance(ends, list) or len(ends) != 2):
        raise ValueError(f'{where}.range is {ends!r}: give [lowest, highest]')
    low_high = None if ends is None else _list(ends, f'{where}.range')
    multiplies = section.get('multiplies', False)
    if not isinstance(multiplies, bool):
        raise ValueError(f'{where}.multiplies is {multiplies!r}: give true or false')
    return TermSpec(
        section['joint'],
        section['place'],
        expression,
        _list(section.get('values') or [], f'{where}.values'),
        None if low_high is None else (low_high[0], low_high[1]),
        multiplies,
        None if section.get('lag_s') is None else _number(section['lag_s'], f'{where}.lag_s'),
    )


def _list(given: Any, where: str) -> tuple[float, ...]:
    if not isinstance(given, list):
        raise ValueError(f'{where} is {given!r}: give a list of numbers')
    return tuple(_number(value, f'{where}[{i}]') for i, value in enumerate(given))
