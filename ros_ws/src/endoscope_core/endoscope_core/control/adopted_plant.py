"""A plant file put into force: what of it can be inverted, how far, and whether that is any use.

`endoscope explain` writes a plant with all the physics that it found. A compensator inverts of it
what stands between motor and tip and does not depend on the time since a recording began, which
nobody knows later. What is left is tried before anything moves: the inverse of each joint is played
through the plant itself. What makes it track worse is left out of the inverse, and with the rest it
has to track better than no compensation at all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.choices import PHYSICAL
from endoscope_core.control.feedforward import Feedforward, FeedforwardLaw, FeedforwardSettings
from endoscope_core.control.internal_model import (
    Added,
    PhysicalParameters,
    added_to,
    bending_range,
    definition_of,
)
from endoscope_core.control.limits import MotorLimits
from endoscope_core.errors import EndoscopeError, FileError
from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.effect import Stage
from endoscope_core.physics.packing import without_functions
from endoscope_core.physics.plant_file import plant_from_mapping
from endoscope_core.physics.simulator import TICK, simulate
from endoscope_core.rig import Rig, digest
from endoscope_core.safety import AdoptionCode, BendingRange, ranges_in_words
from endoscope_core.schema import parse_yaml
from endoscope_core.signals import periodic_signal

LARGEST_TEXT = 100_000
"""Characters of a plant file: a hundred times the nominal one."""
_INVERTED = (Stage.ACTUATOR, Stage.TRANSMISSION, Stage.JOINT)
_CYCLE_S = 2.0 * math.pi

Array = NDArray[np.float64]


class AdoptionError(EndoscopeError):
    """Why a plant is not put into force, in words and as a code."""

    def __init__(self, code: AdoptionCode, words: str) -> None:
        super().__init__(words)
        self.code = code


@dataclass(frozen=True)
class AdoptedPlant:
    """A plant as a compensator puts it into force, for J joints."""

    text: str  # the plant file
    parameters: tuple[PhysicalParameters, ...]  # (J,), what is inverted
    ranges: tuple[BendingRange, ...]  # (J,), within the reach of the rig, rad
    # What the file has and no inverse can know, or tracks better without, `effect of joint`.
    left_out: tuple[str, ...]
    # Rms error of the tip in rad on the trial, with the inverse and without, worst joint of J.
    tried: tuple[float, float]

    @property
    def hash(self) -> str:
        """The first 12 hexadecimal digits of the SHA-256 of the text."""
        return digest(self.text)[:12]

    @property
    def law(self) -> FeedforwardLaw:
        """The feed-forward that inverts it."""
        return FeedforwardLaw(PHYSICAL, self.parameters)

    def check_within(self, angles: tuple[float, ...], joints: tuple[str, ...]) -> None:
        """Raise an AdoptionError where one of the joints is bent (J,), in rad, beyond its range."""
        for joint, angle, within in zip(joints, angles, self.ranges, strict=True):
            if within.keep(angle, 0.0)[0] != angle:
                raise AdoptionError(
                    AdoptionCode.BEYOND_RANGE,
                    f'{joint} is at {math.degrees(angle):.0f} deg; '
                    f'{ranges_in_words((within,), (joint,))}',
                )


def adopted_plant(text: str, rig: Rig, joints: tuple[str, ...]) -> AdoptedPlant:
    """Read a plant file and try its inverse, for some seconds; AdoptionError if that is no good."""
    plant = _read(text)
    if plant.joint_names() != joints:
        raise AdoptionError(
            AdoptionCode.OTHER_JOINTS,
            f'the plant describes {", ".join(plant.joints)}, the rig has {", ".join(joints)}',
        )
    known, left_out = _knowable(plant)
    parameters = tuple(
        PhysicalParameters(
            known.joints[name],
            tuple(entry for entry in added_to(known) if entry.joint == name),
        )
        for name in joints
    )
    limits, reach = MotorLimits.of(rig), rig.joints.reach
    ranges = []
    for name, joint in zip(joints, parameters, strict=True):
        found = bending_range(joint.joint, limits, joint.added)
        within = BendingRange(max(-reach, float(found.low)), min(reach, float(found.high)))
        if not within.low < 0.0 < within.high:
            raise AdoptionError(
                AdoptionCode.NOT_INVERTIBLE,
                f'{name} of the plant cannot be bent either way from straight within the '
                f"motors' travel and tension: from {math.degrees(found.low):.0f} to "
                f'{math.degrees(found.high):.0f} deg',
            )
        ranges.append(within)
    chosen, tried = _tried(known, parameters, ranges, limits)
    worse = [
        f'{definition_of(entry).id} of {entry.joint}'
        for whole, kept in zip(parameters, chosen, strict=True)
        for entry in whole.added
        if entry not in kept.added
    ]
    return AdoptedPlant(text, chosen, tuple(ranges), (*left_out, *worse), tried)


def _read(text: str) -> PlantDescription:
    if len(text) > LARGEST_TEXT:
        raise AdoptionError(
            AdoptionCode.NOT_A_PLANT,
            f'a plant file has at most {LARGEST_TEXT} characters, and this one {len(text)}',
        )
    try:
        content = parse_yaml(text, 'the plant')
        # A file of nothing would be the nominal plant: nobody has explained that.
        if not content:
            raise FileError('the plant is empty: give a plant.yaml')
        return plant_from_mapping(content)
    except FileError as error:
        raise AdoptionError(AdoptionCode.NOT_A_PLANT, str(error)) from error


def _knowable(plant: PlantDescription) -> tuple[PlantDescription, tuple[str, ...]]:
    """The plant between motor and tip without what depends on time, and what is left out so."""
    inverted, left_out = plant, []
    for entry in added_to(plant):
        known = definition_of(entry)
        # What acts between motor and tip, at any time alike, an inverse can know.
        if known.stage in _INVERTED and not known.traits.depends_on_time:
            continue
        if known.stage in _INVERTED:
            left_out.append(f'{known.id} of {entry.joint}')
        if isinstance(entry, EffectSpec):
            kept = tuple(effect for effect in inverted.effects if effect is not entry)
            inverted = replace(inverted, effects=kept)
        else:
            inverted = without_functions(inverted, entry.joint, {known.id})
    return inverted, tuple(left_out)


def _tried(
    plant: PlantDescription,
    parameters: tuple[PhysicalParameters, ...],
    ranges: list[BendingRange],
    limits: MotorLimits,
) -> tuple[tuple[PhysicalParameters, ...], tuple[float, float]]:
    """What tracks best, and the tip's error in rad through the plant itself, and without it."""
    signal = periodic_signal(_CYCLE_S)
    time = np.arange(0.0, signal.duration, TICK)
    angle, velocity = signal(time)
    largest = np.array([min(-within.low, within.high) for within in ranges])
    scale = np.minimum(1.0, largest / np.max(np.abs(angle)))
    desired, speed = angle[:, None] * scale, velocity[:, None] * scale
    steady = time >= signal.steady[0]

    def missed(sent: Array) -> Array:
        """Rms error (J,) in rad."""
        left = (simulate(plant, limits.gear * sent).bending_true - desired)[steady]
        return np.nan_to_num(np.sqrt(np.mean(left**2, axis=0)), nan=np.inf)

    def followed(tried: tuple[PhysicalParameters, ...]) -> Array:
        feedforward = Feedforward(
            len(tried), FeedforwardSettings(speed_limit=limits.speed / limits.gear, limits=limits)
        )
        feedforward.select(FeedforwardLaw(PHYSICAL, tried))
        steps = zip(desired, speed, strict=True)
        return missed(np.array([feedforward.step(*now, TICK) for now in steps]))

    best, with_it, without = parameters, followed(parameters), missed(desired)
    ways = [_with_less(joint) for joint in parameters]
    for k in range(max(map(len, ways))):
        # The joints are tried side by side; one that has no way left plays its best again.
        tried = tuple(own[k] if k < len(own) else b for own, b in zip(ways, best, strict=True))
        error = followed(tried)
        better = error < with_it
        best = tuple(t if b else c for t, b, c in zip(tried, better, best, strict=True))
        with_it = np.minimum(error, with_it)
    for name, error, passed in zip(plant.joints, with_it, without, strict=True):
        if not error < passed:
            raise AdoptionError(
                AdoptionCode.NOT_INVERTIBLE,
                f'{name} of the plant cannot be inverted over the reach: through the plant itself '
                f'the inverse misses by {math.degrees(error):.2f} deg rms, and no compensation by '
                f'{math.degrees(passed):.2f}',
            )
    return best, (float(np.max(with_it)), float(np.max(without)))


def _with_less(joint: PhysicalParameters) -> list[PhysicalParameters]:
    """A joint without each of its effects, its functions, and all of them."""
    functions = tuple(entry for entry in joint.added if not isinstance(entry, EffectSpec))
    parts: list[Added] = [(e,) for e in joint.added if isinstance(e, EffectSpec)]
    parts += [functions] if functions else []
    kept = [tuple(e for e in joint.added if e not in part) for part in parts]
    kept += [()] if len(parts) > 1 else []
    return [replace(joint, added=each) for each in kept]
