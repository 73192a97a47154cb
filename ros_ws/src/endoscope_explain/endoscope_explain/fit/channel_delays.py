"""By how much each channel of a recording is late, with its interval.

A sensor's delay is fitted together with the numbers of the nominal plant, simulated from the first
command on: friction and slack make the tip lag too. A shaft's is the shift at which it follows its
command best. A motion that begins from rest has no period by which either could be mistaken.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_bags.lerobot_dataset import ChannelDelay
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effect import Effect
from endoscope_core.physics.hooks import CELL_INPUT, LINKS, TRACKER, Hook
from endoscope_explain.fit.free_parameters import BAND, effect_parameters
from endoscope_explain.fit.intervals import intervals, with_form
from endoscope_explain.fit.model import TO_THE_END, Fit, JointModel, fit
from endoscope_explain.fit.nominal import is_at_tolerance, with_references
from endoscope_explain.observe.observation import observe, with_held_noise
from endoscope_explain.recording import (
    BENDING,
    LEAST_DURATION_S,
    MOTOR,
    MOVES_RAD,
    WIRES,
    Array,
    RigRecording,
    motor_name,
    wire_names,
)

DELAY = 'delay_s'


def _delay_at(place: Hook) -> Effect:
    # Where sensors read; a delay before them moves the rig itself.
    return next(e for e, _ in LINKS[place.name] if DELAY in {p.name for p in e.parameters})


EFFECTS = {'bending': _delay_at(TRACKER), 'tension': _delay_at(CELL_INPUT)}
"""Effect by which each quantity is late."""
LONGEST_S = 0.5
"""Delay up to which it is looked for: the reach of these effects."""
STEP_S = 1e-3
START_S = 0.02
STAMP, COMMAND = 'its stamp', 'its command'
CHI_SQUARED_90 = 2.706
"""Of one degree of freedom (Wilks' theorem)."""


def channel_delays(
    recording: RigRecording, plant: PlantDescription, jobs: int = 2
) -> tuple[ChannelDelay, ...]:
    """The delay of every measured channel of an audited recording, or why it is unknown."""
    # The plant's effects are in force, and delays among them are where the fit begins.
    shafts = _shafts(recording)
    moved = np.ptp(recording.command.values, axis=0)
    why = {
        joint: 'the joint was not moved'
        if moved[j] < MOVES_RAD or recording.duration < LEAST_DURATION_S
        else 'the motion repeats itself: it must begin from rest'
        if shaft is not None and shaft.value is None
        else ''
        for j, (joint, shaft) in enumerate(zip(recording.joints, shafts, strict=True))
    }
    found = [shaft for shaft in shafts if shaft is not None]
    if all(why.values()):
        return (*found, *(d for joint in why for d in _unknown(joint, EFFECTS, why[joint])))
    observations = tuple(o for o in with_held_noise(observe(recording, plant)) if o.channels)
    # A fit's matrices are tall and narrow: threads would only wait for each other.
    with threadpool_limits(1, 'blas'):
        _, references = with_references(recording, observations, plant, BAND, jobs)
        for refitted, _ in references:
            joint = refitted.model.observation.joint
            quantities = {c.quantity for c in refitted.model.observation.channels} & set(EFFECTS)
            if why[joint] or not quantities:
                found += _unknown(joint, quantities, why[joint])
            else:
                found += _of_joint(refitted, sorted(quantities), jobs)
    return tuple(found)


def _of_joint(refitted: Fit, quantities: Sequence[str], jobs: int) -> list[ChannelDelay]:
    model = _late(refitted.model, quantities)
    late = fit(model, model.begun_at(refitted.theta), iterations=TO_THE_END)
    late = with_form(late, jobs)
    joint = model.observation.joint
    # More than noise is left, and more than another form leaves, or numbers at an end of theirs.
    if late.beyond_form and (late.beyond_form > 1.0 or is_at_tolerance(late)):
        return _unknown(joint, quantities, 'the plant does not explain this recording')
    numbers, result = {each.index: each for each in intervals(late)}, []
    for quantity in quantities:
        late_by = numbers[EFFECTS[quantity].first_parameter]
        value, low, high = late_by.value, late_by.low, late_by.high
        if high >= LONGEST_S:
            result += _unknown(joint, [quantity], f'not limited to less than {LONGEST_S:g} s')
        else:
            result += [ChannelDelay(c, STAMP, value, low, high) for c in _names(joint, quantity)]
    return result


def _late(model: JointModel, quantities: Sequence[str]) -> JointModel:
    """The model with the delays of its sensors free."""
    base, flags, free = model.base.copy(), model.flags.copy(), model.free
    for effect in (EFFECTS[q] for q in quantities):
        if not flags[effect.flag]:
            flags[effect.flag] = True
            base[effect.first_parameter] = START_S
        free += effect_parameters(effect.id)
    return replace(model, base=base, flags=flags, free=free)


def _names(joint: str, quantity: str) -> list[str]:
    if quantity == 'bending':
        return [f'{BENDING}:{joint}']
    return [f'{WIRES}:{wire}' for wire in wire_names(joint)]


def _unknown(joint: str, quantities: Iterable[str], why: str) -> list[ChannelDelay]:
    return [ChannelDelay(c, STAMP, unknown=why) for q in quantities for c in _names(joint, q)]


def _shafts(recording: RigRecording) -> list[ChannelDelay | None]:
    """Delay of each joint's shaft; None where it was not recorded."""
    shaft, command = recording.shaft_position, recording.command
    if shaft is None:
        return [None for _ in recording.joints]
    found: list[ChannelDelay | None] = []
    for j, joint in enumerate(recording.joints):
        valid = shaft.valid[:, j]
        shift = shift_after(
            command.time, command.values[:, j], shaft.time[valid], shaft.values[valid, j]
        )
        name = f'{MOTOR}:{motor_name(joint)}'
        if shift is None:
            found.append(ChannelDelay(name, COMMAND, unknown='several shifts fit as well'))
        else:
            found.append(ChannelDelay(name, COMMAND, *shift))
    return found


def shift_after(
    command_time: Array, command: Array, time: Array, value: Array
) -> tuple[float, float, float] | None:
    """Shift in s at which values (N,) follow a held command (M,) best, with its 90 % interval."""
    # None where shifts apart from each other do so equally well, as in the middle of a sine.
    shifts = np.arange(0.0, LONGEST_S + STEP_S, STEP_S)
    judged = time >= command_time[0] + LONGEST_S
    time, value = time[judged], value[judged]
    if len(time) < 2:
        return None

    def rest(shift: float) -> Array:
        held = np.searchsorted(command_time, time - shift, side='right') - 1
        return np.asarray(value - command[np.maximum(held, 0)])

    squares = np.array([np.mean(rest(shift) ** 2) for shift in shifts])
    best = int(np.argmin(squares))
    left = rest(shifts[best])
    # What is left is not white: fewer residuals are independent (Bartlett's formula for AR(1)).
    along = float(np.clip(left[1:] @ left[:-1] / max(float(left @ left), 1e-300), 0.0, 0.999))
    independent = max(1.0, len(left) * (1.0 - along) / (1.0 + along))
    # A step to the next shift is below what the grid resolves.
    step = float(np.mean((rest(shifts[best] + STEP_S) - left) ** 2))
    limit = max(squares[best] * np.exp(CHI_SQUARED_90 / independent), squares[best] + step)
    as_well = np.flatnonzero(squares <= limit)
    if np.any(np.diff(as_well) > 1) or as_well[-1] == len(shifts) - 1:
        return None
    low, high = shifts[max(as_well[0] - 1, 0)], shifts[as_well[-1] + 1]
    return float(shifts[best]), float(low), float(high)
