"""The files of a report, and what it is made from: files with their hashes, program, command."""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from endoscope_core.names import JOINTS
from endoscope_core.physics.plant_file import save_plant
from endoscope_core.signals.sampled_motion import write_command_file
from endoscope_explain.case import (
    EXPERIMENT_FILE,
    ExplainedCase,
    Ladder,
    Mismatch,
    NextExperiment,
    Provenance,
    Sources,
)
from endoscope_explain.explanation import (
    Estimate,
    NamedEffect,
    NominalEstimate,
    UnknownTerm,
    Verdict,
)
from endoscope_explain.fit.free_parameters import tolerance
from endoscope_explain.prediction_set import Posterior
from endoscope_explain.report.html_page import html_page

SCHEMA = 1
KEYS = {
    'schema': f'version of this form, {SCHEMA}',
    'verdict': ', '.join(f'`{verdict}`' for verdict in Verdict),
    'rig': 'what was recorded, as stated on `rig/kind`: `kind` (`simulated`, `emulated`, `real`, '
    '`unknown`), `program`, `rig_sha256`, `plant` and `plant_sha256`; empty if not stated',
    'where': 'most important first: `stage`, `joint`, `signals`, `intervals` in s from the first '
    'stamp, `regime` in words, `band_hz`',
    'effects': 'what was left out, most certain first: `id`, `joint`, `stage`, `probability`, '
    '`equation`, `source`, `parameters`, `alternatives`, `evidence`, and `left_open`, the set of '
    'names that holds the truth with 90 %: `names` that are one statement here, `probability`',
    'left_open': 'by joint, the same where nothing, or nothing more, is found to be missing',
    'parameters': 'by joint and name: `nominal`, `value`, `low` and `high` of 90 %, `unit`, '
    '`in_band`, `shown`, `together_with`',
    'fit': 'by compared plant (`nominal`, `refitted`, `augmented`) and signal, held out: `rmse`, '
    '`noise`, `rmse_over_noise`; `validation` has the same of a second recording',
    'symbolic': 'the missing term as a formula, or null',
    'next_experiment': '`why`, `separates`, `command`, or null',
    'runtime_s': 'how long it took',
}
"""Of ``report.json``, and what is there."""


def report_mapping(case: ExplainedCase) -> dict[str, Any]:
    """The content of report.json; ValueError if a number without a bound is not finite."""
    term, experiment = case.explanation.unknown, case.next_experiment
    band = case.inputs.sources.band
    fit = _compared(case.ladder)
    if case.validation:
        fit['validation'] = {'recording': case.validation_name, **_compared(case.validation)}
    content = {
        'schema': SCHEMA,
        'verdict': str(case.verdict),
        'rig': case.recording.rig_kind.as_json(),
        'where': [_place(place) for place in case.places],
        'effects': [_effect(effect) for effect in case.effects],
        'left_open': {
            joint: _left_open(case.explanation.left_open(joint))
            for joint in case.explanation.contests
        },
        'parameters': {
            joint: {name: _nominal(name, e, band) for name, e in estimates.items()}
            for joint, estimates in case.explanation.parameters.items()
        },
        'fit': fit,
        'symbolic': None if term is None else _symbolic(term),
        'next_experiment': None if experiment is None else _experiment(experiment),
        'runtime_s': case.runtime_s,
    }
    _require_finite(content)
    return content


def _place(place: Mismatch) -> dict[str, Any]:
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
        'left_open': _left_open(effect.left_open),
    }


def _left_open(left: Posterior) -> list[dict[str, Any]]:
    return [{'names': list(names), 'probability': p} for names, p in left.items()]


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


def _compared(ladder: Ladder) -> dict[str, Any]:
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


def provenance(sources: Sources) -> Provenance:
    """Note what a report is made from, now: the bag's files and the plant's by their hashes."""
    bag, plant = sources.bag, sources.plant_file
    messages = sorted(p for p in bag.iterdir() if p.suffix != '.yaml') if bag.is_dir() else [bag]
    return Provenance(
        str(bag),
        _sha256(*messages),
        '' if plant is None else str(plant),
        '' if plant is None else _sha256(plant),
        version('endoscope_explain'),
        sources.command,
        datetime.now().astimezone().isoformat(timespec='seconds'),
    )


def _sha256(*files: Path) -> str:
    digest = hashlib.sha256()
    for file in files:
        with file.open('rb') as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


REPORT_JSON = 'report.json'
REPORT_HTML = 'report.html'
PLANT_YAML = 'plant.yaml'


def write_report(case: ExplainedCase, folder: Path) -> dict[str, Any]:
    """Write report.json, whose content it returns, report.html, plant.yaml and any next motion."""
    content = report_mapping(case)
    text = json.dumps(content, indent=1, allow_nan=False)
    (folder / REPORT_JSON).write_text(text + '\n', encoding='utf-8')
    (folder / REPORT_HTML).write_text(html_page(case), encoding='utf-8')
    save_plant(case.plant, folder / PLANT_YAML)
    if case.next_experiment is not None:
        experiment = case.next_experiment
        columns = dict(zip(experiment.joints, zip(*experiment.command, strict=True), strict=True))
        # The master plays all joints; one that was not recorded stays at zero.
        joints = tuple(dict.fromkeys((*JOINTS, *experiment.joints)))
        still = (0.0,) * len(experiment.time)
        command = list(zip(*(columns.get(joint, still) for joint in joints), strict=True))
        write_command_file(folder / EXPERIMENT_FILE, experiment.time, command, joints)
    return content
