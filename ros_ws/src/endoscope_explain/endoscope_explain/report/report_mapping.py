"""The content of report.json."""

import math
from typing import Any

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.case import ExplainedCase, Ladder, Place
from endoscope_explain.explanation import (
    ChannelFit,
    Estimate,
    NamedEffect,
    NominalEstimate,
    UnknownTerm,
)
from endoscope_explain.fit.tolerance import tolerance

SCHEMA = 1


def report_mapping(case: ExplainedCase) -> dict[str, Any]:
    """Return the content of report.json: plain, with finite numbers only.

    Parameters
    ----------
    case : ExplainedCase

    Returns
    -------
    dict

    Raises
    ------
    ValueError
        If a number that has no bound to fall back on is not finite.
    """
    return {
        'schema': SCHEMA,
        'verdict': str(case.verdict),
        'where': [_place(place) for place in case.places],
        'effects': [_effect(effect) for effect in case.effects],
        'parameters': {
            joint: {name: _nominal(name, e, case.band) for name, e in estimates.items()}
            for joint, estimates in case.explanation.parameters.items()
        },
        'fit': _ladder(case),
        'symbolic': _symbolic(case.explanation.unknown),
        'next_experiment': _experiment(case),
        'runtime_s': _finite(case.runtime_s, 'runtime_s'),
    }


def _place(place: Place) -> dict[str, Any]:
    return {
        'stage': place.stage,
        'joint': place.joint,
        'signals': list(place.signals),
        'intervals': [[_finite(a, 'interval'), _finite(b, 'interval')] for a, b in place.intervals],
        'regime': place.regime,
        'band_hz': [_finite(f, 'band_hz') for f in place.band_hz],
    }


def _effect(effect: NamedEffect) -> dict[str, Any]:
    known = CATALOGUE[effect.id].parameters if effect.id in CATALOGUE else ()
    bounds = {p.name: (p.low, p.high) for p in known}
    # What chooses a form is no number; plant.yaml has it.
    switches = {p.name for p in known if p.is_switch}
    return {
        'id': effect.id,
        'joint': effect.joint,
        'stage': effect.stage,
        'probability': _finite(effect.probability, f'{effect.id}.probability'),
        'equation': effect.equation,
        'source': effect.source,
        'parameters': {
            name: _estimate(e, f'{effect.id}.{name}', bounds.get(name))
            for name, e in effect.parameters.items()
            if name not in switches
        },
        'alternatives': list(effect.alternatives),
        'evidence': {k: float(v) for k, v in effect.evidence.items() if math.isfinite(v)},
    }


def _estimate(
    estimate: Estimate, where: str, bounds: tuple[float, float] | None = None
) -> dict[str, Any]:
    # A profile that never rises leaves an interval open: it then ends at the parameter's bound.
    low, high = estimate.low, estimate.high
    if bounds is not None:
        low = low if math.isfinite(low) else bounds[0]
        high = high if math.isfinite(high) else bounds[1]
    return {
        'value': _finite(estimate.value, where),
        'low': _finite(low, f'{where}.low'),
        'high': _finite(high, f'{where}.high'),
        'unit': estimate.unit,
    }


def _nominal(name: str, estimate: NominalEstimate, band: float) -> dict[str, Any]:
    low, high = tolerance(name, estimate.nominal, band)
    return {
        'nominal': _finite(estimate.nominal, 'nominal'),
        **_estimate(estimate, 'parameter'),
        'in_band': low <= estimate.value <= high,
    }


def _ladder(case: ExplainedCase) -> dict[str, Any]:
    fit = _rungs(case.ladder)
    if case.validation:
        fit['validation'] = {'recording': case.validation_name, **_rungs(case.validation)}
    return fit


def _rungs(ladder: Ladder) -> dict[str, Any]:
    return {
        rung: {signal: _channel(fit, signal) for signal, fit in signals.items()}
        for rung, signals in ladder.items()
    }


def _channel(fit: ChannelFit, signal: str) -> dict[str, float]:
    return {
        'rmse': _finite(fit.rmse, f'{signal}.rmse'),
        'noise': _finite(fit.noise, f'{signal}.noise'),
        'rmse_over_noise': _finite(fit.ratio, f'{signal}.rmse_over_noise'),
    }


def _symbolic(term: UnknownTerm | None) -> dict[str, Any] | None:
    if term is None:
        return None
    return {
        'expression': term.expression,
        'joint': term.joint,
        'place': term.place,
        'stage': term.stage,
        'physics': term.what,
        'unit': term.unit,
        'states': {term.symbol: term.argument},
        'share_of_formula': _finite(term.formula_share, 'share of the formula'),
        'formula_is_as_good': term.formula_is_as_good,
        'function': {
            term.symbol: [_finite(x, 'argument') for x in term.nodes],
            'value': [_finite(x, 'function') for x in term.values],
            'deviation': [_finite(x, 'deviation') for x in term.deviation],
        },
        'rivals': list(term.rivals),
        'explained': _finite(term.explained, 'explained'),
        'siblings': list(term.siblings),
    }


def _experiment(case: ExplainedCase) -> dict[str, Any] | None:
    experiment = case.next_experiment
    if experiment is None:
        return None
    return {
        'why': experiment.why,
        'separates': list(experiment.separates),
        'command': {
            'file': EXPERIMENT_FILE,
            'motion': experiment.waveform,
            'joint': experiment.joint,
            'duration_s': _finite(experiment.time[-1], 'duration'),
            'largest_angle_rad': max(
                (abs(v) for row in experiment.command for v in row), default=0.0
            ),
            'predicted_distance': {
                k: _finite(v, 'distance') for k, v in experiment.distances.items()
            },
        },
    }


EXPERIMENT_FILE = 'next_experiment.csv'
"""Name of the motion's file beside report.json."""


def _finite(value: float, where: str) -> float:
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f'{where} is {value}: the report holds finite numbers only')
    return value
