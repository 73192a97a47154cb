"""plant.yaml: reading and writing a plant description."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import yaml

from endoscope_core.atomic_output import write_text
from endoscope_core.effects import nearest
from endoscope_core.errors import EndoscopeError
from endoscope_core.plant.packing import pack
from endoscope_core.plant.parameters import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    SensorParameters,
)
from endoscope_core.plant.recording import recording_faults

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
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise PlantFileError(f'cannot read plant file {path}: {error.strerror}') from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        detail = ' '.join(str(error).split())
        raise PlantFileError(f'{path} is not YAML: {detail}') from error
    try:
        return plant_from_mapping({} if content is None else content)
    except ValueError as error:
        raise PlantFileError(f'{path}: {error}') from error


def plant_from_mapping(content: Any) -> PlantDescription:
    """A plant description from the content of a plant.yaml.

    Parameters
    ----------
    content : Mapping
        With the keys `joints`, `sensors` and `effects`, each optional.

    Returns
    -------
    PlantDescription

    Raises
    ------
    ValueError
        If a key is unknown or a value invalid; the message names it and the nearest valid one.
    """
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
    plant = PlantDescription(joints, sensors, tuple(_effect(i, e) for i, e in enumerate(listed)))
    pack(plant)
    recording_faults(plant)
    return plant


def plant_to_mapping(plant: PlantDescription) -> dict[str, Any]:
    """The content of the plant.yaml of a plant, with every key written out."""
    return {
        'joints': {name: asdict(joint) for name, joint in plant.joints.items()},
        'sensors': asdict(plant.sensors),
        'effects': [
            {
                'id': spec.id,
                'joint': spec.joint,
                'parameters': {name: float(v) for name, v in spec.parameters.items()},
            }
            for spec in plant.effects
        ],
    }


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
    return value


def _check_keys(given: Mapping[str, Any], valid: tuple[str, ...], where: str) -> None:
    for key in given:
        if key not in valid:
            raise ValueError(f'unknown key {key} in {where}: {nearest(str(key), valid)}')


def _numbers(given: Any, kind: type, where: str) -> dict[str, float]:
    section = _section(given, where)
    _check_keys(section, tuple(f.name for f in fields(kind)), where)
    return {key: _number(value, f'{where}.{key}') for key, value in section.items()}


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


def _effect(index: int, given: Any) -> EffectSpec:
    where = f'effects[{index}]'
    section = _section(given, where)
    _check_keys(section, ('id', 'joint', 'parameters'), where)
    for key in ('id', 'joint'):
        if not isinstance(section.get(key), str):
            raise ValueError(f'{where} has no {key}: give it as a name')
    parameters = _section(section.get('parameters'), f'{where}.parameters')
    return EffectSpec(
        section['id'],
        section['joint'],
        {key: _number(value, f'{where}.parameters.{key}') for key, value in parameters.items()},
    )
