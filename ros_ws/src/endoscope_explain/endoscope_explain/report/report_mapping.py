"""The content of report.json."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from endoscope_explain.case import ExplainedCase, Ladder, NextExperiment, Place
from endoscope_explain.explanation import Estimate, NamedEffect, NominalEstimate, UnknownTerm
from endoscope_explain.fit.free_parameters import tolerance

SCHEMA = 1
EXPERIMENT_FILE = 'next_experiment.csv'
"""Name of the motion's file beside report.json."""


def report_mapping(case: ExplainedCase) -> dict[str, Any]:
    """Return the content of report.json: plain, with finite numbers only.

    ValueError if a number that has no bound to fall back on is not finite.
    """
    term, experiment = case.explanation.unknown, case.next_experiment
    content = {
        'schema': SCHEMA,
        'verdict': str(case.verdict),
        'where': [_place(place) for place in case.places],
        'effects': [_effect(effect) for effect in case.effects],
        'parameters': {
            joint: {name: _nominal(name, e, case.band) for name, e in estimates.items()}
            for joint, estimates in case.explanation.parameters.items()
        },
        'fit': _ladder(case),
        'symbolic': None if term is None else _symbolic(term),
        'next_experiment': None if experiment is None else _experiment(experiment),
        'runtime_s': case.runtime_s,
    }
    _require_finite(content)
    return content


def _place(place: Place) -> dict[str, Any]:
    return {
        'stage': place.stage,
        'joint': place.joint,
        'signals': list(place.signals),
        'intervals': [[begin, end] for begin, end in place.intervals],
        'regime': place.regime,
        'band_hz': list(place.band_hz),
    }


def _effect(effect: NamedEffect) -> dict[str, Any]:
    known = {p.name: p for p in effect.definition.parameters}
    return {
        'id': effect.id,
        'joint': effect.joint,
        'stage': effect.stage,
        'probability': effect.probability if math.isfinite(effect.probability) else None,
        'equation': effect.definition.equation,
        'source': effect.definition.source,
        'parameters': {
            name: _estimate(e, known[name].low, known[name].high)
            for name, e in effect.parameters.items()
            # What chooses a form is no number; plant.yaml has it.
            if not known[name].is_switch
        },
        'alternatives': list(effect.alternatives),
        'evidence': {k: float(v) for k, v in effect.evidence.items() if math.isfinite(v)},
    }


def _estimate(e: Estimate, least: float = -math.inf, most: float = math.inf) -> dict[str, Any]:
    # A profile that never rises leaves an interval open: it then ends at the parameter's bound.
    low = e.low if math.isfinite(e.low) else least
    high = e.high if math.isfinite(e.high) else most
    return {'value': e.value, 'low': low, 'high': high, 'unit': e.unit}


def _nominal(name: str, estimate: NominalEstimate, band: float) -> dict[str, Any]:
    low, high = tolerance(name, estimate.nominal, band)
    return {
        'nominal': estimate.nominal,
        **_estimate(estimate),
        'in_band': low <= estimate.value <= high,
        'shown': estimate.shown,
        'together_with': estimate.together_with or None,
    }


def _ladder(case: ExplainedCase) -> dict[str, Any]:
    fit = _rungs(case.ladder)
    if case.validation:
        fit['validation'] = {'recording': case.validation_name, **_rungs(case.validation)}
    return fit


def _rungs(ladder: Ladder) -> dict[str, Any]:
    return {
        fits: {
            signal: {'rmse': fit.rmse, 'noise': fit.noise, 'rmse_over_noise': fit.ratio}
            for signal, fit in signals.items()
        }
        for fits, signals in ladder.items()
    }


def _symbolic(term: UnknownTerm) -> dict[str, Any]:
    argument = term.there.argument
    return {
        'expression': term.expression,
        'joint': term.joint,
        'place': term.place,
        'stage': str(term.there.stage),
        'physics': term.there.physics.rstrip('.'),
        'unit': term.there.unit,
        'states': {argument.symbol: f'{argument.words}, {argument.unit}'},
        'share_of_formula': term.formula_share,
        'formula_is_as_good': term.formula_is_as_good,
        'function': {
            argument.symbol: term.nodes.tolist(),
            'value': term.values.tolist(),
            'deviation': term.deviation.tolist(),
        },
        'rivals': list(term.rivals),
        'explained': term.explained,
        'siblings': list(term.siblings),
        'lag_s': term.lag_s,
        'multiplied_by': [_symbolic(factor) for factor in term.factors],
    }


def _experiment(experiment: NextExperiment) -> dict[str, Any]:
    return {
        'why': experiment.why,
        'separates': list(experiment.separates),
        'command': {
            'file': EXPERIMENT_FILE,
            'motion': experiment.waveform,
            'joint': experiment.joint,
            'duration_s': experiment.time[-1],
            'largest_angle_rad': max(abs(v) for row in experiment.command for v in row),
            'predicted_distance': dict(experiment.distances),
        },
    }


def _require_finite(content: object, where: str = '') -> None:
    if isinstance(content, float) and not math.isfinite(content):
        raise ValueError(f'{where} is {content}: the report holds finite numbers only')
    if isinstance(content, Mapping):
        for key, value in content.items():
            _require_finite(value, f'{where}.{key}' if where else key)
    elif isinstance(content, Sequence) and not isinstance(content, str):
        for index, value in enumerate(content):
            _require_finite(value, f'{where}[{index}]')
