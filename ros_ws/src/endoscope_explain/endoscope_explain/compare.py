"""How well each plant does on data that no fit has seen, and what a second recording confirms."""

import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np
from scipy.stats import t

from endoscope_core.physics.layout import IN_COMMAND
from endoscope_explain.case import Ladder
from endoscope_explain.explanation import Explanation, NamedEffect
from endoscope_explain.observe.predicted_signals import RecordedView, fits_by, view
from endoscope_explain.observe.revisits import BLOCK_S
from endoscope_explain.recording import MOVES_RAD, RigRecording
from endoscope_explain.search.judging import FALSE_ALARMS


def confirmed_by(validation: RigRecording, explanation: Explanation) -> tuple[NamedEffect, ...]:
    """The named effects, doubtful where the second recording is not predicted better with them."""
    # Those of a joint are judged together, by the chance at which any term is taken; what is of a
    # device that joints share, on all joints that show it. A joint that rests is left out.
    if not explanation.effects:
        return ()
    plants = {'refitted': explanation.refitted, 'augmented': explanation.augmented}
    seen = view(validation, plants)

    moving = {
        o.joint
        for o in seen.observations
        if o.channels and np.ptp(o.inputs[0, :, IN_COMMAND]) >= MOVES_RAD
    }

    def judged(effect: NamedEffect) -> NamedEffect:
        alike = (e.joint for e in explanation.effects if e.id == effect.id)
        of_device = effect.definition.traits.of_device
        joints = moving & (set(alike) if of_device else {effect.joint})
        if not joints:
            return effect
        chance = chance_of_no_gain(seen, joints)
        evidence = {**effect.evidence, 'second_p_value': chance}
        if chance <= FALSE_ALARMS:
            return replace(effect, evidence=evidence)
        # How often names are right was measured before any second recording spoke.
        return replace(effect, evidence=evidence, doubtful=True, probability=math.nan)

    return tuple(map(judged, explanation.effects))


def chance_of_no_gain(seen: RecordedView, joints: Collection[str]) -> float:
    """P-value of "the augmented plant predicts joints no better than the refitted one"."""
    # What is left r, and what the augmented plant changes d, lower the squares by d (2 r - d).
    # Their sum is positive where r has a slope of more than a half on d: 1 for the right term, 0
    # for one that has nothing to do with it. The slope is a ratio of sums over blocks (Cochran,
    # Sampling Techniques, 1977, ch. 6), so blocks in which the term does not act do not speak
    # against it.
    blocks: dict[int, list[float]] = {}
    for signal in (s for joint in sorted(joints) for s in seen.of_joint(joint)):
        left = signal.residual('refitted')
        change = left - signal.residual('augmented')
        block = ((signal.time - seen.begin) // BLOCK_S).astype(int)
        for k in np.unique(block):
            of = block == k
            sums = blocks.setdefault(int(k), [0.0, 0.0])
            sums[0] += float(left[of] @ change[of])
            sums[1] += float(change[of] @ change[of])
    common, size = np.array(list(blocks.values())).T
    if size.sum() == 0.0:
        return 1.0
    slope, count = common.sum() / size.sum(), len(size)
    spread = np.sqrt(count * np.sum((common - slope * size) ** 2)) / size.sum()
    if count < 2 or spread == 0.0:
        return float(slope <= 0.5)
    return float(t.sf((slope - 0.5) * np.sqrt(count - 1) / spread, count - 1))


PLANTS = ('nominal', 'refitted', 'augmented')


def ladders(explanation: Explanation, validation: RigRecording | None) -> tuple[Ladder, Ladder]:
    """Judge all fits, on held-out blocks and on a second recording, if there is one."""
    held_out = {name: dict(explanation.fit.get(name, {})) for name in PLANTS}
    if validation is None or not held_out['nominal']:
        return held_out, {}
    seen = view(validation, {name: getattr(explanation, name) for name in PLANTS})
    return held_out, {name: fits_by(seen, name) for name in PLANTS}
