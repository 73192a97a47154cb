"""Rigs for the training of the classifier: drawn from a seed and simulated, not stored."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.metrics import NoLoopError, width_at_mid_height
from endoscope_core.physics import EffectSpec, PlantDescription, PlantTrajectory, simulate
from endoscope_core.physics.description import SLAVE, JointParameters
from endoscope_core.physics.family import MOST_BENT, shipped_family
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion, calibration_motion
from endoscope_lab.dataset.calibration_dataset import CLASSES_DEG
from endoscope_lab.dataset.rig_variation import (
    GREATEST_UNEVENNESS,
    calibration_command,
    in_tube,
    random_instrument,
)

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

LEAST_SIZE, GREATEST_SIZE = np.deg2rad([24.0, 128.0])
WIDENING = 1.25
"""Factor on the spreads of training instruments, over those that the classifier must know."""
DIFFERING = (
    'pretension',
    'pretension_profile',
    'wire_stiffness',
    'pulley_radius',
    'joint_radius',
    'joint_stiffness',
    'joint_friction',
    'joint_presliding',
    'section_friction',
    'motor_bandwidth',
)
FADING = ('joint_rest_angle', 'joint_presliding_spread', 'section_straight_angle')
"""Parameters in which the nominal slave differs as an instrument, and those that it lacks."""
_EXTREME = 0.2
_STRAIGHT, _BENT = np.deg2rad([60.0, 240.0])
_SLIPPERY, _ROUGH = (0.1, 0.8), (1.0, 1.5)
_DRAWS = 10
"""Largest number of draws for each rig held out."""
_EARLIER = 1000
"""Samples of the motion before the calibration."""


@dataclass(frozen=True)
class TrainingRigs:
    """R recordings without noise, N samples at 1 kHz."""

    tension: NDArray[np.float32]  # (R, N, 4) in N
    # (R,): backlash size in rad under the sinusoid, mean of the joints; NaN for slack wires or
    # another motion.
    size: Array


def training_rigs(
    seed: int,
    count: int,
    motion: str,
    begin: int,
    progress: Progress | None = None,
    sizes: tuple[float, float] = (LEAST_SIZE, GREATEST_SIZE),
) -> TrainingRigs:
    """Rigs of wide spreads with sizes in a range in rad, recorded from sample `begin` on.

    One of five is nearly straight and slippery, one of five strongly bent and rough; all start at
    the end of a random earlier motion.
    """

    def draw(generator: np.random.Generator) -> PlantDescription:
        plant = _tube(generator, (0.0, MOST_BENT), WIDENING)
        kind = generator.random()
        if kind < _EXTREME:
            plant = _rubbed(_tube(generator, (0.0, _STRAIGHT), WIDENING), generator, _SLIPPERY)
        elif kind < 2.0 * _EXTREME:
            plant = _rubbed(_tube(generator, (_BENT, MOST_BENT), WIDENING), generator, _ROUGH)
        return plant

    def wanted(size: float) -> bool:
        return sizes[0] <= size <= sizes[1]

    return _simulated([seed, 1], count, motion, begin, draw, wanted, progress)


def held_out_rigs(
    seed: int,
    count: int,
    motion: str,
    begin: int,
    progress: Progress | None = None,
    share: float = 0.0,
) -> TrainingRigs:
    """Rigs as in data sets, not used in training, equally many nearest to each class.

    They vary around the recorded instrument, or for a `share` of one around the nominal slave.
    Fewer are found if an instrument hardly has a class, as the nominal slave has 40 deg.
    """
    left = dict.fromkeys(CLASSES_DEG, math.ceil(count / len(CLASSES_DEG)))

    def draw(generator: np.random.Generator) -> PlantDescription:
        # Nearly straight tubes are drawn more often, since their small sizes are rare.
        return _tube(generator, (0.0, MOST_BENT * generator.random()), share=share)

    def wanted(size: float) -> bool:
        nearest = 10 * round(math.degrees(size) / 10.0)
        if not left.get(nearest):
            return False
        left[nearest] -= 1
        return True

    return _simulated(
        [seed, 2, round(share)], count, motion, begin, draw, wanted, progress, _DRAWS * count
    )


def strange_rigs(
    seed: int, count: int, motion: str, begin: int, progress: Progress | None = None
) -> TrainingRigs:
    """Rigs with slack wires, and rigs whose motors did not move as in a calibration."""
    recorded = calibration_motion(motion)
    found = []
    for number in range(count):
        generator = np.random.default_rng([seed, 3, number])
        plant = _tube(generator, (0.0, MOST_BENT))
        command = calibration_command(plant, recorded)
        kind = generator.integers(5)
        if kind == 0:
            joint = str(generator.choice(list(plant.joints)))
            slack = EffectSpec('wire_slack', joint, {'length_m': generator.uniform(0.7e-3, 2.5e-3)})
            plant = replace(plant, effects=(*plant.effects, slack))
        elif kind == 1:
            command *= generator.uniform(0.3, 0.85)
        elif kind == 2:
            command = _paced(command, recorded, generator.uniform(0.4, 0.85))
        elif kind == 3:
            command[:, generator.integers(command.shape[1])] = 0.0
        else:
            command *= 0.0
        wires = simulate(plant, command).tension.reshape(len(command), -1)
        found.append(wires[begin:].astype(np.float32))
        if progress is not None:
            progress(number + 1, count)
    return TrainingRigs(np.stack(found), np.full(count, np.nan))


def _simulated(
    seed: list[int],
    count: int,
    motion: str,
    begin: int,
    draw: Callable[[np.random.Generator], PlantDescription],
    wanted: Callable[[float], bool],
    progress: Progress | None,
    most: float = math.inf,
) -> TrainingRigs:
    recorded, sinusoid = calibration_motion(motion), calibration_motion()
    tensions: list[NDArray[np.float32]] = []
    found: list[float] = []
    number = 0
    while len(found) < count and number < most:
        generator = np.random.default_rng([*seed, number])
        number += 1
        try:
            plant = draw(generator)
        except ValueError:
            # Widened spreads sometimes exceed the bounds of a plant.
            continue
        earlier = _earlier_motion(generator, len(plant.joints))
        moved = np.concatenate([earlier, calibration_command(plant, sinusoid)])
        whole = simulate(plant, moved)
        size = _size(whole, sinusoid)
        if not wanted(size):
            continue
        if recorded.name != sinusoid.name:
            moved = np.concatenate([earlier, calibration_command(plant, recorded)])
            whole = simulate(plant, moved)
        wires = whole.tension.reshape(len(whole.time), -1)[_EARLIER + begin :]
        tensions.append(wires.astype(np.float32))
        found.append(size)
        if progress is not None:
            progress(len(found), count)
    return TrainingRigs(np.stack(tensions), np.array(found))


def _size(whole: PlantTrajectory, sinusoid: CalibrationMotion) -> float:
    """Mean backlash size in rad; zero where there is no loop."""
    settled = whole.bending_true[_EARLIER + sinusoid.settled :]
    time = np.arange(sinusoid.settled, sinusoid.samples) / CALIBRATION_RATE
    desired, _ = sinusoid.signal(time)
    try:
        return float(np.mean([width_at_mid_height(desired, column) for column in settled.T]))
    except NoLoopError:
        return 0.0


def _tube(
    generator: np.random.Generator,
    bends: tuple[float, float],
    widening: float = 1.0,
    share: float | None = None,
) -> PlantDescription:
    instrument = random_instrument(generator, widening)
    unevenness = widening * generator.uniform(-GREATEST_UNEVENNESS, GREATEST_UNEVENNESS)
    plant = in_tube(instrument, generator.uniform(*bends), unevenness)
    if share is None:
        beyond = 0.5 * (widening - 1.0)
        share = generator.uniform(-beyond, 1.0 + beyond)
    return towards_nominal(plant, share)


def towards_nominal(plant: PlantDescription, share: float) -> PlantDescription:
    """The same tube and spreads on an instrument between the recorded one and the nominal slave.

    The two differ by more than instruments of one make, in the radius of a joint by 14 %.
    Parameters are interpolated by a share of their logarithms; those that the nominal slave lacks
    fade.
    """
    recorded, nominal = shipped_family().joint(0.0), SLAVE
    left = max(1.0 - share, 0.0)

    def moved(joint: JointParameters) -> JointParameters:
        factors = {
            name: (getattr(nominal, name) / getattr(recorded, name)) ** share for name in DIFFERING
        }
        numbers = {name: factor * getattr(joint, name) for name, factor in factors.items()}
        numbers |= {name: left * getattr(joint, name) for name in FADING}
        profile = tuple(left * each for each in joint.friction_profile)
        return replace(joint, friction_profile=profile, **numbers)

    return replace(plant, joints={name: moved(joint) for name, joint in plant.joints.items()})


def _rubbed(
    plant: PlantDescription, generator: np.random.Generator, factors: tuple[float, float]
) -> PlantDescription:
    factor = generator.uniform(*factors)
    joints = {
        name: replace(joint, capstan_exponent=factor * joint.capstan_exponent)
        for name, joint in plant.joints.items()
    }
    return replace(plant, joints=joints)


def _earlier_motion(generator: np.random.Generator, joints: int) -> Array:
    """From rest to a random angle and back to zero."""
    phase = np.linspace(0.0, 2.0 * np.pi, _EARLIER)[:, None]
    return 0.5 * (1.0 - np.cos(phase)) * generator.uniform(-0.75, 0.75, joints)


def _paced(command: Array, motion: CalibrationMotion, pace: float) -> Array:
    time = np.arange(motion.samples) / CALIBRATION_RATE
    return np.stack([np.interp(pace * time, time, column) for column in command.T], axis=1)
