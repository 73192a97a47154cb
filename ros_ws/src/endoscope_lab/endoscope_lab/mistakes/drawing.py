"""Recordings of rigs whose parameters and effects differ from the description."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.physics.effect import Effect
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.family import MOST_BENT, shipped_family
from endoscope_core.physics.packing import recording_faults
from endoscope_core.physics.sensing import SensorModel
from endoscope_core.physics.simulator import TICK, simulate
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import motion_by_name
from endoscope_explain.recording import BENDING, COMMAND, MOTOR, WIRES, RigRecording, Series

Array = NDArray[np.float64]
Generator = np.random.Generator

TRACKER_EVERY = 25
MOST_BENDING_RAD = 2.5
"""Largest bending angle that the section survives."""
SCATTERED = (
    'pretension',
    'wire_stiffness',
    'capstan_exponent',
    'joint_stiffness',
    'joint_friction',
    'joint_presliding',
    'joint_damping',
    'motor_bandwidth',
)


def draw_rig(
    rng: Generator, joints: Sequence[str], spread: float, strength: float, effects: int
) -> PlantDescription:
    """A rig of the family of tubes with scattered parameters and some effects of the catalogue."""
    # Parameters scatter by `spread` (rms of the logarithm). Those of each effect lie between their
    # typical value, at a `strength` of 0, and their bound, at 1.
    drawn = {}
    for joint in joints:
        tube = shipped_family().joint(rng.uniform(0.0, MOST_BENT))
        scatter = {k: getattr(tube, k) * np.exp(spread * rng.standard_normal()) for k in SCATTERED}
        drawn[joint] = replace(tube, **scatter)
    ids = [i for i, effect in CATALOGUE.items() if not effect.traits.audited]
    chosen = rng.choice(ids, effects, replace=False)
    specs = [
        EffectSpec(str(i), str(rng.choice(joints)), draw_strength(rng, CATALOGUE[i], strength))
        for i in chosen
    ]
    return PlantDescription(joints=drawn, effects=tuple(specs))


def draw_strength(rng: Generator, effect: Effect, strength: float) -> dict[str, float]:
    """Parameters of an effect of at most that strength."""
    share = rng.uniform(0.0, strength)
    values = {}
    for p in effect.parameters:
        if p.choices:
            values[p.name] = float(rng.choice(p.choices))
        elif np.isnan(p.off):
            values[p.name] = p.typical
        else:
            both = p.low < p.off < p.high
            bound = rng.choice([p.low, p.high]) if both else p.high if p.off <= p.low else p.low
            reach = abs(bound - p.off)
            least = abs(p.typical - p.off) or 0.2 * reach
            step = least ** (1.0 - share) * reach**share
            value = p.off + np.sign(bound - p.off) * step
            values[p.name] = float(np.clip(value, p.low, p.high))
    return values


def draw_motion(rng: Generator, joints: Sequence[str]) -> tuple[Array, Array]:
    """Times (N,) and shaft commands (N, J) of a commissioning, calibration, or sweep and steps."""
    kind = rng.choice(['commissioning', 'calibration', 'swept'])
    if kind == 'swept':
        at = np.arange(0.0, 12.0, TICK)
        stepped = np.where((at % 3.0) < 1.5, 0.5, -0.4)
        angle = np.stack([0.9 * np.sin(1.3 * at), stepped], axis=1)
    else:
        motion = motion_by_name(str(kind))
        at = np.arange(0.0, motion.duration, TICK)
        angle = np.array(motion.sample(at)[0])
        if kind == 'calibration':
            # Two joints with the same motion would be indistinguishable.
            angle[:, 1] = 0.7 * np.interp(np.maximum(at - 2.0, 0.0), at, angle[:, 0])
    return at, angle[:, : len(joints)] * shipped_rig().joints.gear


def read(
    plant: PlantDescription, at: Array, command: Array, seed: int, noisy: bool = True
) -> tuple[RigRecording, bool]:
    """Recording of a rig by its sensors, and whether the rig survives the motion."""
    truth = simulate(plant, command)
    sensors = SensorModel(plant.sensors, seed)

    def series(topic: str, time: Array, values: Array, sense: Callable[[Array], Array]) -> Series:
        return Series.of(topic, time, sense(values) if noisy else values.copy())

    slow = slice(None, None, TRACKER_EVERY)
    recording = RigRecording(
        'drawn',
        0.0,
        plant.joint_names(),
        Series.of(COMMAND, at, command.copy()),
        series(WIRES, at, truth.tension, sensors.tension),
        series(BENDING, at[slow], truth.bending[slow], sensors.bending),
        series(MOTOR, at, truth.shaft_position, sensors.shaft_position),
        series(MOTOR, at, truth.shaft_velocity, sensors.shaft_velocity),
        series(MOTOR, at, truth.shaft_effort, sensors.shaft_effort),
    )
    faults = recording_faults(plant)
    bending = recording.bending
    at_joint = faults.spoilt(bending.values, bending.time)
    survives = bool(
        np.isfinite(truth.tension).all()
        and truth.tension.max() < shipped_rig().tension.ceiling
        and np.abs(truth.bending).max() < MOST_BENDING_RAD
    )
    return recording.with_series({'bending': replace(bending, values=at_joint)}), survives


def draw_recording(
    rng: Generator,
    joints: Sequence[str],
    spread: float,
    strength: float,
    effects: int,
    noisy: bool = True,
) -> tuple[RigRecording, PlantDescription]:
    """A recording of a rig that survives its motion, and the plant of the rig."""
    while True:
        plant = draw_rig(rng, joints, spread, strength, effects)
        at, command = draw_motion(rng, joints)
        try:
            recording, survives = read(plant, at, command, int(rng.integers(2**31)), noisy)
        except ValueError:
            # An effect at a bound may be invalid in combination with another one.
            continue
        if survives:
            return recording, plant


def described(recording: RigRecording) -> PlantDescription:
    """The nominal plant, as described to the audit."""
    return PlantDescription(joints={joint: JointParameters() for joint in recording.joints})


def names_of(rng: Generator, count: int = 1) -> tuple[str, ...]:
    """Names of one or two joints, at least `count`."""
    return ('bend_x', 'bend_y')[: max(count, int(rng.integers(1, 3)))]


def sound_recording(seed: int) -> RigRecording:
    """A recording of a rig with one or two effects up to their bounds; one in ten without noise."""
    rng = np.random.default_rng(seed)
    noisy = bool(rng.random() < 0.9)
    return draw_recording(rng, names_of(rng), 0.3, 1.0, int(rng.integers(1, 3)), noisy)[0]
