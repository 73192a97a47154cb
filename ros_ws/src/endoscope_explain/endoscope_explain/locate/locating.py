"""Where a mismatch is: stage, signals, time, state and frequency."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import periodogram, savgol_filter

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.layout import IN_MOTOR
from endoscope_core.physics.simulator import TICK
from endoscope_explain.audit import Finding
from endoscope_explain.case import ChainCut, Mismatch, changed_parameters
from endoscope_explain.explanation import Explanation, NamedEffect
from endoscope_explain.fit.free_parameters import nominal_number
from endoscope_explain.fit.model import simulate_joint
from endoscope_explain.locate.excess import (
    SignalExcess,
    conditions,
    drive,
    excess_between,
    intervals,
    onset,
    regime_in_words,
    shares,
)
from endoscope_explain.observe.observation import JointObservation, observe
from endoscope_explain.observe.predicted_signals import packed_rig, reading_lead, simulate_rig
from endoscope_explain.open_questions import without
from endoscope_explain.recording import Array, RigRecording

SMOOTHED_S = 0.021
"""Window over which the encoder's steps are smoothed: shorter than the servo's answer."""
BEHIND = ('tension', 'bending')
OF_THE_MOTOR = {'shaft_position', 'shaft_velocity'}
"""Its effort is what the wires pull by."""


def cut_at_motor(recording: RigRecording, plant: PlantDescription) -> tuple[ChainCut, ...]:
    """Compare both ways to drive wires and joint by a plain plant; none without shaft reading."""
    shaft = recording.shaft_position
    if shaft is None:
        return ()
    observations = observe(recording, plant)
    whole = simulate_rig(observations, plant)
    lead = reading_lead(observations, whole)
    parameters, flags = packed_rig(observations, plant)
    cuts = []
    for j, observation in enumerate(observations):
        inputs = observation.inputs.copy()
        k = recording.joints.index(observation.joint)
        time = shaft.time - recording.command.time[0] + lead * TICK
        inputs[0, :, IN_MOTOR] = _at_ends_of_ticks(time, shaft.values[:, k], inputs.shape[1])
        out = simulate_joint(observation, parameters[j], flags[j], inputs)
        misfits = (_misfit(observation, each, lead) for each in (whole[j], out))
        cuts.append(ChainCut(observation.joint, *misfits))
    return tuple(cuts)


def _at_ends_of_ticks(time: Array, angle: Array, ticks: int) -> Array:
    """The angle that a motor shall have reached at the end of each tick, smoothed."""
    period = float(np.median(np.diff(time)))
    width = max(5, 2 * int(0.5 * SMOOTHED_S / period) + 1)
    return np.interp(TICK * np.arange(1, ticks + 1), time, savgol_filter(angle, width, 2))


def _misfit(observation: JointObservation, outputs: Array, lead: float) -> float:
    wrong = [
        (channel.predicted(outputs, lead) - channel.value) / channel.noise
        for channel in observation.channels
        if channel.quantity in BEHIND
    ]
    return float(np.sqrt(np.mean(np.concatenate(wrong) ** 2))) if wrong else 0.0


def band_hz(excess: SignalExcess) -> tuple[float, float]:
    """Find the band in Hz that holds 90 % of what the prediction lacks."""
    # The lower end is 0 where a constant is part of it.
    time, missing = excess.view.time, excess.missing
    if len(time) < 8:
        return 0.0, 0.0
    period = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1], period)
    frequency, power = periodogram(np.interp(grid, time, missing), 1.0 / period, detrend=False)
    total = power.sum()
    if total <= 0.0:
        return 0.0, 0.0
    cumulative = np.cumsum(power) / total
    low = frequency[np.searchsorted(cumulative, 0.05)]
    high = frequency[min(np.searchsorted(cumulative, 0.95), len(frequency) - 1)]
    return float(low), float(high)


def locate_effects(
    recording: RigRecording, plant: PlantDescription, effects: Sequence[NamedEffect]
) -> list[Mismatch]:
    """Say where each effect of an explained recording shows, but for those that the plant lacks."""
    # The plant with all effects is compared with the same plant without the one in question: what
    # the measurement then has in excess is that effect's trace.
    located = []
    for effect in effects:
        rest = without(plant, effect)
        if rest == plant:
            continue
        found = excess_between(recording, rest, plant)
        time = effect.parameters.get('time_s')
        began = None if time is None else time.value
        located.append(place(recording, found, effect.stage, effect.joint, began))
    return located


def locate_unknown(recording: RigRecording, explanation: Explanation) -> list[Mismatch]:
    """Say where a mismatch shows that no effect of the catalogue explains."""
    term = explanation.unknown
    found = excess_between(recording, explanation.refitted, None)
    if term is not None and term.helps:
        return [place(recording, found, str(term.there.stage), term.joint)]
    return [place(recording, found, _shows_in(found), found[0].view.joint)]


def _shows_in(found: Sequence[SignalExcess]) -> str:
    """Stage of what is wrong with no function known, by the signals that show it."""
    # What follows a motor that goes elsewhere is off because of it.
    own = [e for e in found if e.view.joint == found[0].view.joint]
    if {e.view.quantity for e in own if e.view.signal in shares(own)} & OF_THE_MOTOR:
        return 'actuator'
    # Off by more than its noise: a tracker has too few samples for a share of the misfit.
    off = {e.view.quantity for e in found if e.total > len(e.excess)}
    behind = off & {'tension', 'bending'}
    if not behind:
        return 'actuator'
    # A wrong tension bends the joint wrongly too: alone, either is misread.
    return 'joint' if len(behind) == 2 else 'sensing'


def locate_parameters(recording: RigRecording, explanation: Explanation) -> list[Mismatch]:
    """Say where parameters that changed show, stage by stage."""
    found = excess_between(recording, explanation.nominal, explanation.refitted)
    stages = dict.fromkeys(
        (str(nominal_number(name).stage), joint)
        for joint, estimates in explanation.parameters.items()
        for name in changed_parameters(estimates)
    )
    return [place(recording, found, stage, joint) for stage, joint in stages]


def locate_findings(findings: Sequence[Finding]) -> list[Mismatch]:
    """Say where what the audit found is."""
    return [
        Mismatch(f.stage, f.joint, f.signals, f.intervals[:12], f.text, (0.0, 0.0))
        for f in findings
    ]


def place(
    recording: RigRecording,
    found: Sequence[SignalExcess],
    stage: str,
    joint: str,
    began: float | None = None,
) -> Mismatch:
    """Describe one trace in signals, time, state and frequency; `found` is of both joints."""
    by_signal = shares(found)
    j = recording.joints.index(joint)
    telling = [e for e in found if e.view.signal in by_signal] or list(found[:1])
    end = recording.duration
    regime = regime_in_words(telling, conditions(recording, j))
    if began is None:
        began = onset(telling, drive(recording, j, end), end)
    if began is not None:
        rest = '' if regime == 'throughout' or regime.startswith('after') else f', {regime}'
        regime = f'from {began:.1f} s on{rest}'
    return Mismatch(
        stage,
        joint,
        tuple(by_signal) or (telling[0].view.signal,),
        intervals(telling, end),
        regime,
        band_hz(telling[0]),
        by_signal,
        began,
    )
