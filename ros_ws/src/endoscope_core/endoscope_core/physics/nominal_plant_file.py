"""A complete plant.yaml to begin with: every key, its nominal value, unit and meaning."""

from dataclasses import asdict
from typing import Any

from endoscope_core.physics.description import JointParameters, SensorParameters
from endoscope_core.physics.plant_file import JOINT_NAMES
from endoscope_core.physics.plant_numbers import NUMBERS


def nominal_plant_text() -> str:
    """Return the nominal rig as a plant.yaml with comments, which `load_plant` reads."""
    lines = [
        '# The nominal plant, whole. Every key may be left out and has this value then.',
        'joints:',
    ]
    for name in JOINT_NAMES:
        lines += [f'  {name}:', *_lines(asdict(JointParameters()), 4)]
    lines += ['sensors:', *_lines(asdict(SensorParameters()), 2)]
    lines += [
        '# Physics beyond that: `endoscope effects` lists it, `endoscope effects ID` tells all.',
        '# effects:',
        '#   - {id: ID, joint: bend_x, parameters: {NAME: NUMBER}}',
        'effects: []',
    ]
    return '\n'.join(lines) + '\n'


def _lines(values: dict[str, Any], indent: int) -> list[str]:
    lines = []
    for key, value in values.items():
        known = NUMBERS[key]
        shown = list(value) if isinstance(value, tuple) else value
        text = f'{" " * indent}{key}: {shown}'
        lines.append(f'{text:40}  # {known.unit + "; " if known.unit else ""}{known.meaning}')
    return lines
