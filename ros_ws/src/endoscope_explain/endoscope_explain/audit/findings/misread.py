"""Readings or a command in another unit, sign or order, and readings that nothing makes fit."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from endoscope_explain.audit.examined import Examined
from endoscope_explain.audit.finding import Finding, FindingKind, Severity, column_name
from endoscope_explain.audit.findings import frozen
from endoscope_explain.audit.misreading import Misreading
from endoscope_explain.audit.plausibility import Comparison, as_meant
from endoscope_explain.recording import QUANTITY_UNITS, Array, RigRecording

MISFITS = ' (misfit {percent:.3g} % as recorded, {percent_corrected:.3g} % as corrected)'
UNIT = FindingKind(
    'wrong_unit',
    Severity.MISTAKE,
    '{signals} {are} {times} what the plant can give: in {unit}, not in {wanted}' + MISFITS,
    'divide by {factor:.6g}, or give the unit when the table is converted',
)
COUNTS = FindingKind(
    'wrong_unit',
    Severity.MISTAKE,
    '{signals} {are} about {factor:.2g} times what the plant can give, which is not a unit of '
    'force: counts of a converter, not N' + MISFITS,
    'give what one count is in N as scale when the table is converted',
)
GEAR = FindingKind(
    'wrong_gear',
    Severity.MISTAKE,
    '{signals} {turn} {factor:.3g} times as far as commanded by {command}: a gear is wrong on the '
    'way of one of them' + MISFITS,
    'divide the position or multiply the command by {factor:.4g}, whichever is wrong',
)
SIGN = FindingKind(
    'wrong_sign',
    Severity.MISTAKE,
    '{signals} {are} of the wrong sign: negated, {they_fit} the plant' + MISFITS,
    'multiply by -1',
)
EXCHANGED = FindingKind(
    'exchanged',
    Severity.MISTAKE,
    '{signals} are exchanged: {which}' + MISFITS,
    'exchange their names, or the plugs',
)
UNLIKE = FindingKind(
    'unlike_the_plant',
    Severity.NOTE,
    '{signals} {have} nothing in common with what the plant gives, and no unit, sign or order '
    'that is known makes {them} fit',
    'fitted as recorded',
)
_SINGULAR: dict[str, Any] = {
    'are': 'is',
    'have': 'has',
    'turn': 'turns',
    'them': 'it',
    'they_fit': 'it fits',
}
_PLURAL: dict[str, Any] = {word: word.replace('_', ' ') for word in _SINGULAR}

Shares = Mapping[str, Array]
"""By quantity, of each column: what no lag, offset and scale make of the simulated one."""


def find(seen: Examined) -> Examined:
    """Give all columns as they must be meant, and leave out what was found frozen."""
    recording, comparison = seen.recording, seen.comparison
    if comparison is None or not frozen.moves(recording.command):
        return seen
    stood = [f for f in seen.findings if f.id == frozen.KIND.id]
    if stood:
        topics = {signal.partition(':')[0] for f in stood for signal in f.signals}
        still = [n for n, s in recording.measured().items() if s.topic in topics]
        comparison = Comparison(recording, seen.plant, still)
    # A small motion in which play hides the tip fits wrong units better than right ones: what an
    # earlier recording showed of the set-up is corrected already.
    mistakes = comparison.judged() if seen.before is None else ()
    before, after = comparison.shares(), comparison.shares(mistakes)
    # An exchange of motors is one for all that their messages hold.
    found: dict[object, Finding] = {}
    for mistake in mistakes:
        finding = _finding(recording, mistake, before, after)
        topic = finding.signals[0].partition(':')[0]
        what = mistake.kind if mistake.kind == 'order' else mistake.quantity
        found.setdefault((topic, what, mistake.source), finding)
    unlike = comparison.unlike(mistakes)
    if unlike:
        words = _SINGULAR if len(unlike) == 1 else _PLURAL
        found[UNLIKE] = UNLIKE.found(recording, unlike, **words)
    meant = frozen.without(as_meant(recording, mistakes), stood)
    known = (*seen.misreadings, *mistakes)
    return seen.found(*found.values(), recording=meant, misreadings=known)


def _finding(
    recording: RigRecording, mistake: Misreading, before: Shares, after: Shares
) -> Finding:
    """A mistake, with the misfits before and after all are put right."""
    quantity = mistake.quantity
    evidence = {'misfit': _misfit(mistake, before), 'misfit_corrected': _misfit(mistake, after)}
    factor = next((f for f in mistake.factor if f != 1.0), 1.0)
    if mistake.of_gear and quantity == 'shaft_position':
        kind = GEAR
    else:
        kind = {'unit': UNIT, 'factor': COUNTS, 'sign': SIGN, 'order': EXCHANGED}[mistake.kind]
    if kind in (UNIT, COUNTS, GEAR):
        evidence['factor'] = factor
    else:
        # Plugs and signs are of a device.
        sensed = quantity in ('tension', 'bending')
        kind = replace(kind, stage='sensing' if sensed else 'actuator')
    names = [column_name(recording, (quantity, c)) for c in range(len(mistake.source))]
    short = [name.rpartition(':')[2] for name in names]
    return kind.found(
        recording,
        [(quantity, c) for c in mistake.touched],
        times=f'{factor:.3g} times' if factor > 1.0 else f'1/{1.0 / factor:.3g} of',
        unit=mistake.unit,
        wanted=QUANTITY_UNITS.get(quantity, 'rad'),
        command=recording.command.topic,
        which=', '.join(f'{short[mistake.source[c]]} holds {short[c]}' for c in mistake.touched),
        percent=100 * evidence['misfit'],
        percent_corrected=100 * evidence['misfit_corrected'],
        evidence=evidence,
        **(_SINGULAR if len(mistake.touched) == 1 else _PLURAL),
    )


def _misfit(mistake: Misreading, shares: Shares) -> float:
    """Share (rms) of what a mistake spoils: of a wrong command, all that was measured."""
    if mistake.quantity == 'command':
        spoilt = np.concatenate(list(shares.values()))
    else:
        spoilt = shares[mistake.quantity][list(mistake.touched)]
    return float(np.sqrt(np.mean(np.minimum(spoilt, 1.0) ** 2)))
