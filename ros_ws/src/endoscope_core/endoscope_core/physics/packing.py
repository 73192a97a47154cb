"""From a plant description to the compiled physics' flat arrays, and to a recording's faults."""

import functools
import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from endoscope_core.compiled import Array, Flags
from endoscope_core.errors import InputError, nearest
from endoscope_core.physics import layout
from endoscope_core.physics.description import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    TermSpec,
)
from endoscope_core.physics.effect import NominalPhysics
from endoscope_core.physics.effects import CATALOGUE, NOMINAL_PHYSICS, describe
from endoscope_core.physics.functions import FUNCTIONS, describe_place
from endoscope_core.physics.functions.evaluation import ADDS, FLAGS_OF_FUNCTIONS, MULTIPLIES
from endoscope_core.physics.functions.term import tabulated
from endoscope_core.physics.hooks import ON_SAMPLES
from endoscope_core.physics.kernel import settle, turn_to
from endoscope_core.physics.sensing import RecordingFaults


def with_nominal_in_place(plant: PlantDescription) -> PlantDescription:
    """The same plant with nominal physics that is among its effects as numbers of its joints."""
    pack(plant)
    joints, kept = dict(plant.joints), []
    for spec in plant.effects:
        if spec.id in NOMINAL_PHYSICS:
            names = [parameter.name for parameter in describe(spec.id).parameters]
            numbers = dict(zip(names, effect_values(spec).tolist(), strict=True))
            joints[spec.joint] = replace(joints[spec.joint], **numbers)
        else:
            kept.append(spec)
    return replace(plant, joints=joints, effects=tuple(kept))


def effect_values(spec: EffectSpec) -> Array:
    """Checked values of an effect's parameters in slot order, typical where none are given."""
    definition = describe(spec.id)
    names = [parameter.name for parameter in definition.parameters]
    for name in spec.parameters:
        if name not in names:
            raise InputError(f'effect {spec.id} has no parameter {name}: {nearest(name, names)}')
    values = np.array(
        [
            float(spec.parameters.get(parameter.name, parameter.typical))
            for parameter in definition.parameters
        ]
    )
    for parameter, value in zip(definition.parameters, values, strict=True):
        if not math.isfinite(value) or not parameter.low <= value <= parameter.high:
            raise ValueError(
                f'effect {spec.id}: {parameter.name} is {value:g}, it must be between '
                f'{parameter.low:g} and {parameter.high:g} {parameter.unit}'
            )
        if parameter.counted and not value.is_integer():
            raise ValueError(
                f'effect {spec.id}: {parameter.name} is {value:g}, it must be a whole number'
            )
    return values


def pack(plant: PlantDescription) -> tuple[Array, Flags]:
    """Parameters (J, parameters) and flags (J, flags) of a plant.

    The flags are of bool, or of `FLAGS_OF_FUNCTIONS` where the plant has terms. An effect or place
    that is unknown, on an unknown joint, given twice or out of bounds is an InputError or a
    ValueError.
    """
    names = plant.joint_names()
    parameters = np.zeros((len(names), layout.SLOTS.parameters))
    flags = np.zeros((len(names), layout.SLOTS.flags), dtype=np.bool_)
    for row, joint in zip(parameters, plant.joints.values(), strict=True):
        row[: layout.FRICTION_PROFILE + len(joint.friction_profile)] = _nominal(joint)
        for effect in (*CATALOGUE.values(), *FUNCTIONS.values()):
            row[effect.places] = [parameter.typical for parameter in effect.parameters]
    for spec in plant.effects:
        if spec.joint not in names:
            raise InputError(
                f'effect {spec.id} is on joint {spec.joint}: {nearest(spec.joint, names)}'
            )
        j = names.index(spec.joint)
        values = effect_values(spec)
        definition = describe(spec.id)
        if flags[j, definition.flag]:
            raise ValueError(f'effect {spec.id} is given twice on joint {spec.joint}')
        first = definition.first_parameter
        if isinstance(definition, NominalPhysics) and not definition.is_lacking(parameters[j]):
            name = definition.parameters[0].name
            raise ValueError(
                f'effect {spec.id}: joint {spec.joint} has it already, its {name} is '
                f'{parameters[j, first]:g}: leave out one of the two'
            )
        flags[j, definition.flag] = True
        parameters[j, first : first + len(values)] = values
    if plant.terms:
        flags = flags.astype(FLAGS_OF_FUNCTIONS)
    for term in plant.terms:
        if term.joint not in names:
            raise InputError(
                f'unknown_term at {term.place} is on joint {term.joint}: '
                f'{nearest(term.joint, names)}'
            )
        j, place = names.index(term.joint), describe_place(term.place)
        if flags[j, place.flag]:
            raise ValueError(f'unknown_term at {term.place} is given twice on joint {term.joint}')
        flags[j, place.flag] = MULTIPLIES if term.multiplies else ADDS
        parameters[j, place.places] = tabulated(term).numbers
    _check_products(plant.terms)
    return parameters, flags


def without_functions(
    plant: PlantDescription, joint: str, places: Collection[str]
) -> PlantDescription:
    """A plant without the functions at some places of a joint, and what only multiplied them."""
    kept = tuple(t for t in plant.terms if t.joint != joint or t.place not in places)
    alone = _multiplying_nothing(kept)
    return replace(plant, terms=tuple(t for t in kept if t not in alone))


def _multiplying_nothing(terms: tuple[TermSpec, ...]) -> list[TermSpec]:
    def acts_on(term: TermSpec) -> tuple[str, object]:
        return term.joint, describe_place(term.place).point

    added = {acts_on(term) for term in terms if not term.multiplies}
    return [term for term in terms if term.multiplies and acts_on(term) not in added]


def _check_products(terms: tuple[TermSpec, ...]) -> None:
    """Refuse what multiplies nothing: its plant would be another one than meant."""
    for term in _multiplying_nothing(terms):
        raise ValueError(
            f'unknown_term at {term.place} on joint {term.joint} multiplies nothing: add the '
            'unknown_term that it multiplies, or leave out multiplies'
        )


def recording_faults(plant: PlantDescription) -> RecordingFaults:
    """Faults of a plant's recordings; ValueError if joints disagree about the tracker's clock."""
    joints = plant.joint_names()
    parts = []
    for spec in plant.effects:
        effect, values = describe(spec.id), effect_values(spec)
        if spec.id in ON_SAMPLES:
            named = {p.name: float(v) for p, v in zip(effect.parameters, values, strict=True)}
            parts.append(ON_SAMPLES[spec.id](named, joints.index(spec.joint)))
    return functools.reduce(RecordingFaults.joined, parts, RecordingFaults())


def _nominal(joint: JointParameters) -> list[float]:
    return [*(getattr(joint, key) for key in layout.NOMINAL_KEYS), *joint.friction_profile]


def rest_state(
    parameters: Array,
    on: Flags,
    tick: float,
    shaft: Array | None = None,
    speed: Array | None = None,
) -> tuple[Array, Array, Array]:
    """States, histories and sheaths of J joints at rest, or just set in motion.

    Row j of each is joint j's array as `settle` has it. `parameters` and `on` are from `pack`,
    `tick` is in s. `shaft` (J,) or (J, K) in rad: where each motor has gone since the wires were
    tightened at zero, or K angles one after the other. `speed` (J,) in rad/s: of each motor, which
    is on its way to its command. Both are zero if not given.
    """
    joints = len(parameters)
    states = np.zeros((joints, layout.SLOTS.states))
    histories = np.zeros((joints, layout.HISTORIES, layout.HISTORY))
    sheaths = np.zeros((joints, layout.SHEATH_ROWS, layout.CELLS + 1))
    angles = np.zeros((joints, 1)) if shaft is None else np.reshape(shaft, (joints, -1))
    for j in range(joints):
        joint = (states[j], histories[j], sheaths[j], parameters[j], on[j])
        settle(*joint, angles[j, 0], tick)
        for angle in angles[j, 1:]:
            turn_to(*joint, angle)
    if speed is not None:
        states[:, layout.MOTOR_SPEED] = speed
    return states, histories, sheaths
