"""One bag or many, explained side by side."""

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any

from endoscope_core.atomic_output import atomic_directory, require_free_directory
from endoscope_core.errors import InputError
from endoscope_core.workers import worker_pool
from endoscope_explain.case import ExplainedCase, Sources
from endoscope_explain.pipeline import Progress, explain_case, read_inputs
from endoscope_explain.report.sentences import terminal_text, verdict_sentence
from endoscope_explain.report.writing import REPORT_HTML, provenance, write_report
from endoscope_explain.takes import physics_of_all

SUMMARY_CSV = 'summary.csv'
PARAMETERS_CSV = 'parameters.csv'
SUMMARY = (
    'bag',
    'verdict',
    'effects',
    'margins',
    'nominal_rmse_over_noise',
    'augmented_rmse_over_noise',
    'runtime_s',
)
"""Columns of the summary."""

Say = Callable[[str], None]


Content = Mapping[str, Any]
"""What a report.json contains."""


def explained_case(sources: Sources, progress: Progress | None = None) -> ExplainedCase:
    """Explain one bag; BagError if a recording cannot be used."""
    report = progress or (lambda _: None)
    inputs = read_inputs(sources)
    for note in inputs.audit.recording.notes:
        report(f'note: {note}')

    def answered(case: ExplainedCase) -> None:
        report(f'found: {verdict_sentence(case)}')

    case = explain_case(inputs, progress=progress, answered=answered)
    return replace(case, provenance=provenance(sources))


def explained_cases(
    sources: Sequence[Sources], progress: Progress | None = None
) -> list[ExplainedCase]:
    """Explain bags side by side, of one rig where they have the `same_physics`."""
    sources = _prepared(sources, progress)
    cases: dict[int, ExplainedCase] = {}
    for index, case in _as_they_come(sources, progress):
        cases[index] = case
        if progress is not None and len(sources) > 1:
            progress(f'{len(cases)}/{len(sources)} {case.recording.name}')
    return [case for _, case in sorted(cases.items())]


def explain_bags(
    sources: Sequence[Sources], out: Path, *, say: Say = print, progress: Progress | None = None
) -> dict[str, Content]:
    """Explain bags and write their reports to a folder, all or none; what these contain."""
    # One report has the folder to itself, else each has its own in it.
    require_free_directory(out)
    sources = _prepared(sources, progress or say)
    names, alone = unique_names([one.bag for one in sources]), len(sources) == 1
    written: dict[str, Content] = {}
    last = f'Reports: {out}'
    with atomic_directory(out) as folder:
        for index, case in _as_they_come(sources, progress):
            name = names[index]
            own = folder if alone else folder / name
            own.mkdir(exist_ok=alone)
            written[name] = write_report(case, own)
            if alone:
                last = f'{terminal_text(case)}\nReport: {out / REPORT_HTML}'
            else:
                say(f'{len(written)}/{len(sources)} {name}: {verdict_sentence(case)}')
        in_order = {name: written[name] for name in names}
        if not alone:
            (folder / SUMMARY_CSV).write_text(summary_table(in_order), encoding='utf-8')
            (folder / PARAMETERS_CSV).write_text(parameter_table(in_order), encoding='utf-8')
    say(last)
    return in_order


def unique_names(bags: Sequence[Path]) -> list[str]:
    """Return a folder name for each bag, with a number where bags share theirs."""
    names: list[str] = []
    for bag in bags:
        stem = bag.name.removesuffix('.mcap')
        name, count = stem, 1
        while name in names:
            count += 1
            name = f'{stem}_{count}'
        names.append(name)
    return names


def summary(name: str, content: Content) -> dict[str, Any]:
    """Return one bag's line of the summary as plain data."""
    return {
        'bag': name,
        'verdict': content['verdict'],
        'effects': [
            {'id': each['id'], 'joint': each['joint'], 'margin': each['evidence'].get('margin')}
            for each in content['effects']
        ],
        'nominal_rmse_over_noise': _largest(content['fit']['nominal']),
        'augmented_rmse_over_noise': _largest(content['fit']['augmented']),
        'runtime_s': content['runtime_s'],
    }


def summary_table(reports: Mapping[str, Content]) -> str:
    """Return one CSV line for each bag: verdict, effects, largest misfit before and after."""
    rows = []
    for name, content in reports.items():
        line = summary(name, content)
        effects = line['effects']
        line['effects'] = ' '.join(f'{e["id"]}@{e["joint"]}' for e in effects)
        margins = [each['margin'] for each in effects]
        line['margins'] = ' '.join('-' if m is None else f'{m:.1f}' for m in margins)
        for key in ('nominal_rmse_over_noise', 'augmented_rmse_over_noise'):
            # Where the rig moved too little, nothing was fitted.
            line[key] = '' if line[key] is None else f'{line[key]:.2f}'
        line['runtime_s'] = f'{line["runtime_s"]:.1f}'
        rows.append([line[key] for key in SUMMARY])
    return _csv(SUMMARY, rows)


def parameter_table(reports: Mapping[str, Content]) -> str:
    """Return one CSV line for each fitted parameter, bags beside each other in columns."""
    # A cell is empty where a recording does not show the parameter.
    columns: dict[tuple[str, str, str], dict[str, float]] = {}
    for name, content in reports.items():
        for joint, estimates in content['parameters'].items():
            for parameter, estimate in estimates.items():
                row = columns.setdefault((joint, 'plant', parameter), {})
                if estimate['shown']:
                    row[name] = estimate['value']
        for effect in content['effects']:
            for parameter, estimate in effect['parameters'].items():
                key = (effect['joint'], effect['id'], parameter)
                columns.setdefault(key, {})[name] = estimate['value']
    rows = [
        [*key, *(f'{values[name]:.5g}' if name in values else '' for name in reports)]
        for key, values in columns.items()
    ]
    return _csv(['joint', 'of', 'parameter', *reports], rows)


def _csv(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator='\n').writerows([head, *rows])
    return text.getvalue()


def _largest(fits: Mapping[str, Mapping[str, float]]) -> float | None:
    return max((fit['rmse_over_noise'] for fit in fits.values()), default=None)


def _prepared(sources: Sequence[Sources], report: Progress | None) -> Sequence[Sources]:
    """Sources of which each can be explained for itself, after all of several were read."""
    if sources[0].same_physics:
        if any(one.baseline is not None for one in sources):
            raise InputError('same physics and a baseline are mutually exclusive')
        all_given = physics_of_all(sources, report or (lambda _: None))
        return [replace(o, given=g) for o, g in zip(sources, all_given, strict=True)]
    if len(sources) > 1:
        for one in sources:
            read_inputs(one)
    return sources


def _as_they_come(
    sources: Sequence[Sources], progress: Progress | None
) -> Iterator[tuple[int, ExplainedCase]]:
    """Explained cases with their places among the sources: several side by side."""
    if len(sources) == 1:
        yield 0, explained_case(sources[0], progress)
        return
    with worker_pool(min(sources[0].jobs, len(sources))) as pool:
        futures = {
            pool.submit(explained_case, replace(one, jobs=1)): i for i, one in enumerate(sources)
        }
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
