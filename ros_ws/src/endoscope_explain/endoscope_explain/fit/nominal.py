"""The nominal plant fitted to every joint of a recording: where all searches begin.

A difference from the plant that was already there in health is no news. Where both recordings have
the same commands it is known sample by sample and taken off; elsewhere its size is added to the
noise.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from threadpoolctl import threadpool_limits

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.layout import OUT_JOINT
from endoscope_core.physics.simulator import TICK
from endoscope_core.workers import parallel_map
from endoscope_explain.audit.misreading import OTHER_RIGS
from endoscope_explain.fit.evidence import is_noise, log_evidence
from endoscope_explain.fit.free_parameters import SCALED_NOMINAL, FreeParameter, nominal_parameters
from endoscope_explain.fit.model import (
    TO_THE_END,
    Fit,
    JointModel,
    fit,
    jacobian,
    packed_joint,
    simulate_joint,
)
from endoscope_explain.observe.observation import Channel, JointObservation, StampsOnTicks, observe
from endoscope_explain.observe.predicted_signals import view
from endoscope_explain.options import BAND
from endoscope_explain.recording import MOVES_RAD, Array, Mask, RigRecording, Series, signal_name

SPIKE = 8.0
"""Height in noise units of a residual that stands alone: of 4, right samples have it as well."""
ALONE = 5.0
"""Factor by which it is above the usual residual nearby."""
NEARBY = 15
"""Samples whose median size is the usual one."""
AROUND = 7
"""Samples whose median is what the one in their middle should be."""
SAME_STAMP_S = 1e-6
"""Stamps that differ by less are the same one."""


def without_isolated(
    recording: RigRecording, observations: tuple[JointObservation, ...], fits: tuple[Fit, ...]
) -> tuple[JointObservation, ...]:
    """Leave out tracker samples that stick out of the residual; the same tuple where none does."""
    # Where the audit found no wrong sample, none is left out here: a spike may be physics.
    if recording.bending.valid.all():
        return observations
    cleaned = tuple(
        _without_isolated(observation, fit)
        for observation, fit in zip(observations, fits, strict=True)
    )
    before, after = (sum(o.size for o in group) for group in (observations, cleaned))
    return cleaned if after < before else observations


def _without_isolated(observation: JointObservation, fit: Fit) -> JointObservation:
    channels = tuple(
        _kept(channel, fit.residuals[part]) if channel.quantity == 'bending' else channel
        for channel, part in zip(observation.channels, observation.slices(), strict=True)
    )
    return replace(observation, channels=channels)


def with_isolated_marked(recording: RigRecording, plant: PlantDescription) -> RigRecording:
    """Mark tracker samples that stick out of what a plant predicts as wrong, if others were."""
    bending = recording.bending
    if bending.valid.all():
        return recording
    seen = view(recording, {'explained': plant})
    valid = bending.valid.copy()
    for j, joint in enumerate(recording.joints):
        signal = signal_name('bending', joint)
        if signal in seen.signals:
            shown = seen.signals[signal]
            wrong = shown.time[_sticks_out(shown.residual('explained'))]
            valid[np.searchsorted(bending.time, wrong - SAME_STAMP_S), j] = False
    return recording.with_series({'bending': replace(bending, valid=valid)})


def _sticks_out(residual: Array) -> NDArray[np.bool_]:
    # Mirrored at the ends: with the last sample repeated, a wrong one would be its own median.
    usual = median_filter(np.abs(residual), NEARBY, mode='mirror')
    # Up to three samples in a row stick out of the median; a step of the joint does not.
    height = residual - median_filter(residual, AROUND, mode='mirror')
    return np.asarray(np.abs(height) > np.maximum(SPIKE, ALONE * usual))


def _kept(channel: Channel, residual: Array) -> Channel:
    wrong = _sticks_out(residual)
    if not wrong.any():
        return channel
    keep = ~wrong
    # A tracker sample is one raw sample.
    return replace(
        channel,
        stamps=StampsOnTicks(
            channel.stamps.tick[keep],
            channel.stamps.share[keep],
            np.arange(int(keep.sum())),
            channel.stamps.count[keep],
        ),
        time=channel.time[keep],
        value=channel.value[keep],
        noise=channel.noise[keep],
    )


SAME_COMMAND_RAD = 1e-6


def against_baseline(observation: JointObservation, healthy: Fit) -> JointObservation:
    """A joint's observation, corrected by what the plant never explained of it in health."""
    before = healthy.model.observation
    repeated = _same_commands(observation, before)
    known = {
        channel.signal: (channel, healthy.residuals[part])
        for channel, part in zip(before.channels, before.slices(), strict=True)
    }
    channels = tuple(
        _corrected(c, *known[c.signal], repeated) if c.signal in known else c
        for c in observation.channels
    )
    return replace(observation, channels=channels)


def _same_commands(one: JointObservation, other: JointObservation) -> bool:
    length = min(one.inputs.shape[1], other.inputs.shape[1])
    return bool(
        abs(one.inputs.shape[1] - other.inputs.shape[1]) <= 2
        and np.max(np.abs(one.inputs[0, :length, 0] - other.inputs[0, :length, 0]))
        < SAME_COMMAND_RAD
    )


def _corrected(channel: Channel, before: Channel, residual: Array, repeated: bool) -> Channel:
    size = float(np.mean(residual**2))
    same_stamps = len(channel.time) == len(before.time) and np.allclose(
        channel.time, before.time, atol=1e-4
    )
    if repeated and same_stamps and size > 1.1:
        # The residual is simulated minus measured.
        return replace(
            channel,
            value=channel.value + residual * before.noise,
            noise=np.hypot(channel.noise, before.noise),
        )
    beyond = max(size - 1.0, 0.0)
    return replace(
        channel,
        noise=channel.noise * np.sqrt(1.0 + beyond),
        lasting=float(np.sqrt(channel.lasting**2 + beyond * np.mean(channel.noise**2))),
    )


ReferenceFits = tuple[Fit, Fit]
"""A joint's nominal plant refitted, and as described."""

AT_THE_END = 1e-3
"""Relative distance from the end of a band within which a number counts as being at it."""


def with_references(
    recording: RigRecording,
    observations: tuple[JointObservation, ...],
    plant: PlantDescription,
    band: float,
    jobs: int,
) -> tuple[tuple[JointObservation, ...], list[ReferenceFits]]:
    """Fit the nominal plant, and once more where that shows isolated wrong samples."""
    packed = {o.joint: packed_joint(plant, o.joint) for o in observations}
    references = all_references(observations, packed, jobs, band)
    cleaned = without_isolated(recording, observations, tuple(fitted for fitted, _ in references))
    if cleaned is observations:
        return observations, references
    return cleaned, all_references(cleaned, packed, jobs, band)


def all_references(
    observations: tuple[JointObservation, ...],
    packed: dict[str, tuple[Array, Mask]],
    jobs: int,
    band: float = BAND,
) -> list[ReferenceFits]:
    """The nominal plant of every joint, each beside the other as refitted."""
    references = parallel_map(
        lambda o: nominal_references(o, *packed[o.joint], band), observations, jobs
    )
    if len(references) != 2:
        return references
    return [
        beside(pair, other) for pair, (other, _) in zip(references, references[::-1], strict=True)
    ]


def beside(references: ReferenceFits, other: Fit) -> ReferenceFits:
    """A joint's reference fits where the other joint moves as it does in a fit of its own."""
    angle = simulated_bending(other)
    fitted, described = (_seen_with(one, angle) for one in references)
    return fitted, described


def _seen_with(one: Fit, angle: Array) -> Fit:
    model = replace(one.model, observation=one.model.observation.beside(angle))
    residuals = model.residuals(one.theta)
    if np.array_equal(residuals, one.residuals):
        # Nothing that the plant has depends on the other joint.
        return replace(one, model=model)
    slopes = jacobian(model, one.theta)
    return Fit(model, one.theta, residuals, slopes, model.cost(residuals, one.theta))


def simulated_bending(fitted: Fit) -> Array:
    """Bending angle (N,) in rad of a fitted joint at every tick of its recording."""
    parameters, _ = fitted.model.packed(fitted.theta)
    return simulate_joint(fitted.model.observation, parameters, fitted.model.flags)[:, OUT_JOINT]


def nominal_references(
    observation: JointObservation,
    base: Array,
    flags: Mask,
    band: float = BAND,
) -> ReferenceFits:
    """The nominal plant refitted, and as described, each with its derivative."""
    model = JointModel(observation, base, flags, nominal_parameters(base, band))
    theta = np.array([item.mean for item in model.free])
    residuals = model.residuals(theta)
    described = Fit(
        model,
        theta,
        residuals,
        jacobian(model, theta),
        0.5 * float(residuals @ residuals),
    )
    refitted = fit(model, theta, known_jacobian=described.jacobian)
    if is_noise(refitted):
        return refitted, described
    # On to the end only where no physics is missing: it would bend the parameters ever further.
    finished = fit(model, refitted.theta, iterations=TO_THE_END, known_jacobian=refitted.jacobian)
    return finished if is_noise(finished) else refitted, described


def is_at_tolerance(fitted: Fit) -> bool:
    """Whether a fit holds a nominal number at an end of its band."""
    low, high = fitted.model.bounds()
    at_the_end = np.minimum(fitted.theta - low, high - fitted.theta) < AT_THE_END
    free = fitted.model.free
    return any(e and i.name in SCALED_NOMINAL for e, i in zip(at_the_end, free, strict=True))


def with_any_numbers(fitted: Fit) -> Fit:
    """Refit with nominal numbers that may leave their band."""
    # A rig that is described wrongly by a third lacks no physics. Within its band no refit shows
    # that, and an effect that can do a wrong number's work would be named for it. The priors stay,
    # so that a number far from its description has its price.
    model = fitted.model
    model = replace(model, free=tuple(_widened(item) for item in model.free))
    return fit(model, fitted.theta, iterations=TO_THE_END)


def _widened(item: FreeParameter) -> FreeParameter:
    if item.name not in SCALED_NOMINAL:
        return item
    return replace(item, low=item.low / OTHER_RIGS, high=item.high * OTHER_RIGS)


SLOW_S = 2.0 * TICK
"""Time from one command to the next, in the middle, from which on it may have moved between."""
GAP = 5.0
"""Times as long a pause is one in which the command was held."""


def with_command_between_rows(recording: RigRecording, plant: PlantDescription) -> RigRecording:
    """The recording with its command straight between rows, where the rig follows that better."""
    # A table may have every tenth command of a stream: held from row to row it comes half a row
    # late and in steps, which looks like a servo that errs. The evidence of the nominal plant,
    # refitted to both, decides.
    command = recording.command
    apart = float(np.median(np.diff(command.time))) if len(command.time) > 1 else 0.0
    if apart <= SLOW_S or float(np.max(np.ptp(command.values, axis=0))) < MOVES_RAD:
        return recording
    straight = replace(recording, command=_straight(command, GAP * apart))
    held, followed = (_evidence(each, plant) for each in (recording, straight))
    if followed <= held:
        return recording
    note = (
        f'the command goes straight between its rows, {1e3 * apart:.1f} ms apart: by '
        f'{followed - held:.0f} nats the rig follows that, and not a command that is held'
    )
    return replace(straight, notes=(*recording.notes, note))


def _straight(command: Series, gap: float) -> Series:
    """A command on ticks that goes straight from row to row, but over a gap."""
    begin = float(command.time[0])
    time = begin + TICK * np.arange(round((float(command.time[-1]) - begin) / TICK) + 1)
    last = np.searchsorted(command.time, time, side='right') - 1
    pauses = np.append(np.diff(command.time) > gap, True)[last]
    values = np.column_stack([np.interp(time, command.time, v) for v in command.values.T])
    values = np.where(pauses[:, None], command.values[last], values)
    return Series.of(command.topic, np.asarray(time, np.float64), values)


def _evidence(recording: RigRecording, plant: PlantDescription) -> float:
    """Logarithm of the evidence of the nominal plant, refitted."""
    with threadpool_limits(1, 'blas'):
        seen = [each for each in observe(recording, plant) if each.channels]
        fits = (nominal_references(o, *packed_joint(plant, o.joint))[0] for o in seen)
        return sum(map(log_evidence, fits))
