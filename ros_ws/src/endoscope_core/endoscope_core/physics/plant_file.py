"""plant.yaml: reading and writing a plant description."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, make_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import FileError, nearest
from endoscope_core.names import JOINTS
from endoscope_core.physics.description import (
    NUMBERS,
    SLAVE,
    EffectSpec,
    JointParameters,
    PlantDescription,
    SensorParameters,
    TermSpec,
)
from endoscope_core.physics.functions import FUNCTIONS, describe_place
from endoscope_core.physics.packing import recording_faults, with_nominal_in_place
from endoscope_core.schema import Before, Number, blamed_on, load_yaml, read, within

UNKNOWN_TERM = 'unknown_term'
"""Id of what is added to the plant and is no effect of the catalogue."""


def _as_in_file(kind: type[JointParameters] | type[SensorParameters]) -> Any:
    """The dataclass with the reach of each number, and the nominal values as defaults."""
    return make_dataclass(
        kind.__name__,
        [(f.name, _number(f.name), field(default=f.default)) for f in fields(kind)],
        namespace={'__post_init__': lambda given: kind(**vars(given))},
        frozen=True,
    )


def _number(key: str) -> Any:
    known = NUMBERS[key]

    def ended(value: Any) -> Any:
        return known.high if known.endless and value == math.inf else value

    number = Annotated[Number, Before(ended), within(known.low, known.high, known.unit)]
    return tuple[number, ...] if key == 'friction_profile' else number


_Joint = _as_in_file(JointParameters)
_Sensors = _as_in_file(SensorParameters)


def _as_formula(value: Any) -> Any:
    # YAML reads the formula of a constant as a number.
    constant = isinstance(value, int | float) and not isinstance(value, bool)
    return str(float(value)) if constant else value


@dataclass(frozen=True)
class _Term:
    id: str
    joint: str
    stage: str
    place: str = ''
    expression: Annotated[str, Before(_as_formula)] = ''
    values: tuple[Number, ...] = ()
    range: tuple[Number, Number] | None = None  # lowest, highest
    multiplies: bool = False
    lag_s: Number | None = None

    def __post_init__(self) -> None:
        stages = {str(place.stage) for place in FUNCTIONS.values()}
        if self.stage not in stages:
            raise ValueError(f'unknown stage {self.stage}: {nearest(self.stage, stages)}')
        here = [name for name, place in FUNCTIONS.items() if place.stage == self.stage]
        if not self.place:
            raise ValueError(f'place is missing: valid are {", ".join(here)}')
        if self.place not in FUNCTIONS:
            raise ValueError(f'unknown place {self.place}: {nearest(self.place, here)}')
        if self.place not in here:
            stage = FUNCTIONS[self.place].stage
            raise ValueError(f'{self.place} is a place of the stage {stage}, not {self.stage}')

    def spec(self) -> TermSpec:
        return TermSpec(**{f.name: getattr(self, f.name) for f in fields(TermSpec)})


@dataclass(frozen=True)
class _Plant:
    joints: Mapping[Literal[JOINTS], _Joint] = field(  # type: ignore[valid-type]
        default_factory=lambda: dict.fromkeys(JOINTS, _Joint())
    )
    sensors: _Sensors = field(default_factory=_Sensors)  # type: ignore[valid-type]
    effects: Annotated[tuple[Any, ...], Before(lambda given: given or ())] = ()

    def __post_init__(self) -> None:
        if not self.joints:
            raise ValueError('joints is empty: name bend_x, bend_y or both')


def load_plant(path: str | Path) -> PlantDescription:
    """Read a plant.yaml, of nominal values where keys are missing; FileError if it is no plant."""
    try:
        content = load_yaml(path)
    except FileError as error:
        raise FileError(f'plant file: {error}') from error
    if content is None:
        raise FileError(
            f'plant file {path} is empty: name joints at least, such as joints: {{bend_x: {{}}}}'
        )
    return plant_from_mapping(content, f'plant file {path}')


def plant_from_mapping(content: Any, where: str = 'the plant') -> PlantDescription:
    """Plant from a plant.yaml's content; a FileError names `where`, a wrong key and the nearest."""
    given = read(_Plant, content, where)
    entries = [_entry(entry, where, f'effects[{i}]') for i, entry in enumerate(given.effects)]
    plant = PlantDescription(
        {
            name: JointParameters(**vars(given.joints[name]))
            for name in JOINTS
            if name in given.joints
        },
        SensorParameters(**vars(given.sensors)),
        tuple(entry for entry in entries if isinstance(entry, EffectSpec)),
        tuple(entry for entry in entries if isinstance(entry, TermSpec)),
    )
    with blamed_on(where):
        plant = with_nominal_in_place(plant)
        recording_faults(plant)
    return plant


def _entry(given: Any, where: str, key: str) -> EffectSpec | TermSpec:
    if isinstance(given, Mapping) and given.get('id') == UNKNOWN_TERM:
        return read(_Term, given, where, key).spec()
    return read(EffectSpec, given, where, key)


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
    """Write a plant.yaml that `load_plant` reads back to an equal plant; OSError if it cannot."""
    write_text(path, plant_as_text(plant))


def plant_as_text(plant: PlantDescription) -> str:
    """All of a plant as YAML, as `save_plant` writes it."""
    return yaml.safe_dump(plant_to_mapping(plant), sort_keys=False)


def nominal_plant_text() -> str:
    """Return the simulated slave as a plant.yaml with comments, which `load_plant` reads."""
    left_out = JointParameters()
    lines = [
        '# The simulated slave, whole. A key may be left out and has this value then, but for a',
        f'# joint_friction of {left_out.joint_friction:g}, and a section_friction of none.',
        'joints:',
    ]
    for name in JOINTS:
        lines += [f'  {name}:', *_commented(asdict(SLAVE), 4)]
    lines += ['sensors:', *_commented(asdict(SensorParameters()), 2)]
    lines += [
        '# Physics beyond that: `endoscope effects` lists it, `endoscope effects ID` tells all.',
        '# effects:',
        '#   - {id: ID, joint: bend_x, parameters: {NAME: NUMBER}}',
        'effects: []',
    ]
    return '\n'.join(lines) + '\n'


def _commented(values: dict[str, Any], indent: int) -> list[str]:
    lines = []
    for key, value in values.items():
        known = NUMBERS[key]
        shown = list(value) if isinstance(value, tuple) else value
        text = f'{" " * indent}{key}: {shown}'
        lines.append(f'{text:40}  # {known.unit + "; " if known.unit else ""}{known.meaning}')
    return lines
