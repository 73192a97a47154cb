"""From a plant description to the flat arrays that the compiled physics works on."""

import math
from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import (
    CATALOGUE,
    UnknownEffectError,
    describe,
    nearest,
    presliding_shape,
)
from endoscope_core.effects.slots import HISTORY, SLIDE_A, SLIDE_B, SLOTS, START_FRICTION
from endoscope_core.plant.parameters import EffectSpec, PlantDescription

START_SLIDES = (
    (SLIDE_A, 1),
    (SLIDE_B, 1),
    (presliding_shape.WIRE_A, 1 + presliding_shape.ELEMENTS),
    (presliding_shape.WIRE_B, 1 + presliding_shape.ELEMENTS),
)
"""First index and number of the states that hold the friction of a sheath of one piece."""


def effect_values(spec: EffectSpec) -> NDArray[np.float64]:
    """Values of an effect's parameters in slot order, typical where the spec gives none.

    Raises
    ------
    UnknownEffectError
        If the effect or one of its parameters is unknown.
    ValueError
        If a value is not finite, outside the parameter's bounds or, where it must be, not whole.
    """
    definition = describe(spec.id)
    names = [parameter.name for parameter in definition.parameters]
    for name in spec.parameters:
        if name not in names:
            raise UnknownEffectError(
                f'effect {spec.id} has no parameter {name}: {nearest(name, names)}'
            )
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


def pack(plant: PlantDescription) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Parameter and flag arrays of a plant.

    Parameters
    ----------
    plant : PlantDescription

    Returns
    -------
    parameters : array (J, parameters)
    flags : array (J, flags) of bool

    Raises
    ------
    UnknownEffectError, ValueError
        If an effect is unknown, on an unknown joint, given twice, or out of bounds.
    """
    names = plant.joint_names()
    parameters = np.zeros((len(names), SLOTS.parameters))
    flags = np.zeros((len(names), SLOTS.flags), dtype=np.bool_)
    for row, joint in zip(parameters, plant.joints.values(), strict=True):
        nominal = astuple(joint)
        row[: len(nominal)] = nominal
        for definition in CATALOGUE.values():
            for i, parameter in enumerate(definition.parameters):
                row[definition.first_parameter + i] = parameter.typical
    for spec in plant.effects:
        if spec.joint not in names:
            raise UnknownEffectError(
                f'effect {spec.id} is on joint {spec.joint}: {nearest(spec.joint, names)}'
            )
        j = names.index(spec.joint)
        values = effect_values(spec)
        definition = CATALOGUE[spec.id]
        if flags[j, definition.flag]:
            raise ValueError(f'effect {spec.id} is given twice on joint {spec.joint}')
        flags[j, definition.flag] = True
        first = definition.first_parameter
        parameters[j, first : first + len(values)] = values
    return parameters, flags


def rest_state(
    parameters: NDArray[np.float64], motor: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States and histories of joints at rest, their wires slid towards the motor as packed.

    Only friction of one piece knows its start: a sheath in segments has not slid either way.

    Parameters
    ----------
    parameters : array (J, parameters)
    motor : array (J,), optional
        Joint-equivalent motor angle in rad at which motor and joint rest; zero if not given.

    Returns
    -------
    states : array (J, states)
    histories : array (J, 2, HISTORY)
    """
    joints = len(parameters)
    states = np.zeros((joints, SLOTS.states))
    histories = np.zeros((joints, 2, HISTORY))
    for first, count in START_SLIDES:
        states[:, first : first + count] = parameters[:, START_FRICTION, None]
    if motor is not None:
        for index in SLOTS.resting_angles:
            states[:, index] = motor
        histories[:] = motor[:, None, None]
    return states, histories
