"""A joint of the compiled physics with some effects, run over a command."""

from typing import NamedTuple

import numpy as np

from endoscope_core.physics import kernel
from endoscope_core.physics import layout as L
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.hooks import ON_SAMPLES
from endoscope_core.physics.sheath import JOINT_END, MOTOR_END

NOMINAL = {
    'pretension': 5.0,
    'pretension_profile': 0.75,
    'wire_stiffness': 3000.0,
    'pulley_radius': 0.0024,
    'joint_radius': 0.0008,
    'capstan_exponent': 0.9,
    'joint_stiffness': 0.0045,
    'joint_rest_angle': 0.0,
    'joint_friction': 9e-4,
    'joint_presliding': 0.03,
    'joint_presliding_spread': 0.0,
    'section_friction': 0.0,
    'section_straight_angle': 0.0,
    'joint_damping': 1e-5,
    'motor_bandwidth': 30.0,
    'motor_damping_ratio': 0.9,
}
BLOCKED = {'joint_stiffness': 1e3, 'capstan_exponent': 1e-6}
"""Nominal parameters of wires without friction behind which nothing gives way."""
LOOSE = {'pretension': 0.0, 'wire_stiffness': 1e-3, 'joint_friction': 0.0, 'capstan_exponent': 0.0}
"""And of a bending section that answers to moments alone."""
ACTING = tuple(effect_id for effect_id in CATALOGUE if effect_id not in ON_SAMPLES)


class Run(NamedTuple):
    """What the sensors read, arrays (N,), and the states at the end."""

    motor: np.ndarray
    speed: np.ndarray
    effort: np.ndarray
    a: np.ndarray
    b: np.ndarray
    bending: np.ndarray
    joint: np.ndarray
    states: np.ndarray
    sheath: np.ndarray

    def ends(self):
        """Tensions in N of each wire at the motor and at the joint, at the end of the run."""
        at_motor = kernel.tensions(self.states, self.sheath, MOTOR_END)
        at_joint = kernel.tensions(self.states, self.sheath, JOINT_END)
        return tuple(zip(at_motor, at_joint, strict=True))


def sliding_ratio(ramp):
    """Logarithm of the pulled wire's tensions at the motor and at the joint, after a ramp."""
    (motor, joint), _ = ramp.ends()
    return float(np.log(motor / joint))


def hand(ticks, tick, size=0.5):
    """A shaft command (ticks,) that pauses, reverses within itself and never repeats."""
    time = tick * np.arange(ticks)
    wave = 0.7 * np.sin(2.3 * time) + 0.4 * np.sin(0.87 * 2.3 * time**1.1 + 0.4) - 0.4 * np.sin(0.4)
    return size * np.clip(wave, -0.9, 0.8)


def run(command, effects=None, tick=1e-3, *, start=0.0, other=0.0, motor=None, **plant):
    """One joint under a shaft command (N,).

    Parameters
    ----------
    command : array (N,)
    effects : dict of effect id to dict of its parameters
        Of parameters that are not given, the typical values hold.
    tick : float
    start : float
        Shaft angle at which it has settled.
    other, motor : float or array (N,)
        The other joint's angle; measured angle of the shaft, instead of the servo's.
    plant
        Nominal parameters that differ.
    """
    command = np.asarray(command, dtype=float)
    p = np.zeros((1, L.SLOTS.parameters))
    on = np.zeros((1, L.SLOTS.flags), dtype=bool)
    for i, key in enumerate(L.NOMINAL_KEYS):
        p[0, i] = plant.pop(key, NOMINAL[key])
    profile = plant.pop('friction_profile', ())
    p[0, L.FRICTION_PROFILE : L.FRICTION_PROFILE + len(profile)] = profile
    assert not plant, plant
    for effect_id, given in (effects or {}).items():
        effect = CATALOGUE[effect_id]
        on[0, effect.flag] = True
        values = {each.name: each.typical for each in effect.parameters} | given
        assert len(values) == len(effect.parameters), given
        p[0, effect.first_parameter : effect.first_parameter + len(values)] = list(values.values())
    x = np.zeros((1, L.SLOTS.states))
    histories = np.zeros((1, L.HISTORIES, L.HISTORY))
    sheaths = np.zeros((1, L.SHEATH_ROWS, L.CELLS + 1))
    kernel.settle(x[0], histories[0], sheaths[0], p[0], on[0], start, tick)
    inputs = np.zeros((1, len(command), L.INPUTS))
    inputs[0, :, L.IN_COMMAND] = command
    inputs[0, :, L.IN_OTHER_JOINT] = other
    inputs[0, :, L.IN_MOTOR] = np.nan if motor is None else motor
    out = np.empty((1, len(command), L.OUTPUTS))
    kernel.run_joints(x, histories, sheaths, p, on, inputs, False, tick, out)
    return Run(*out[0].T, x[0], sheaths[0])
