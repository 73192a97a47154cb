"""`endoscope bench explain`: what explanations say of recordings whose truth is known."""

import argparse
import json
import resource
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endoscope_core.physics import load_plant
from endoscope_explain.many_bags import explain_one
from endoscope_explain.pipeline import Sources

TRUTH = '.truth.json'


@dataclass(frozen=True)
class Outcome:
    """What was said of one case, beside its truth."""

    # All that was concealed is named, or listed as an alternative where the motion tells no more.
    right: bool
    exact: bool  # and nothing else is named
    # Each number that could be measured another way: true value, estimate and interval.
    numbers: tuple[str, ...]


def run(args: argparse.Namespace) -> int:
    """Run and print; return 0 if all cases are right, else 1."""
    plant = load_plant(args.folder / 'plant.yaml')
    names = sorted(p.name.removesuffix(TRUTH) for p in args.folder.glob(f'*{TRUTH}'))
    names = [name for name in names if not args.only or name in args.only]
    print(f'{"":28s}{"":7s}{"verdict":18s}{"wall":>6s}{"CPU":>6s}  second recording  named')
    outcomes = []
    for name in names:
        truth = json.loads((args.folder / f'{name}{TRUTH}').read_text(encoding='utf-8'))
        second, baseline = (
            _if_there(args.folder / f'{name}.{kind}.mcap') for kind in ('second', 'baseline')
        )
        sources = Sources(args.folder / f'{name}.mcap', plant, baseline, second, quick=True)
        begun, cpu = time.monotonic(), _cpu_seconds()
        report = explain_one(sources, args.jobs).content()
        wall, cpu = time.monotonic() - begun, _cpu_seconds() - cpu
        outcome = judged(report, truth)
        outcomes.append(outcome)
        print(
            f'{name:28s}{"right" if outcome.right else "WRONG":7s}{report["verdict"]!s:18s}'
            f'{wall:6.0f}{cpu:6.0f}  {_worst(report):16s}  {", ".join(_named(report)) or "-"}',
            flush=True,
        )
        for line in outcome.numbers:
            print(f'{"":30s}{line}')
    right = sum(outcome.right for outcome in outcomes)
    exact = sum(outcome.exact for outcome in outcomes)
    print(f'{right} of {len(outcomes)} right, {exact} with no name too many')
    return 0 if right == len(outcomes) else 1


def judged(report: Mapping[str, Any], truth: Mapping[str, Any]) -> Outcome:
    """Compare the content of a report.json with the truth of its case.

    The truth has `effects`: ids; `also_true`: ids that may be named as well; `verdict`: one that is
    asked for, or None; `excitation`: `calibration` where the motion is too poor to tell rivals
    apart; `comparable`: true values by effect and parameter.
    """
    concealed, allowed = set(truth['effects']), set(truth.get('also_true', ()))
    named = [name for name in _named(report) if name not in allowed]
    if concealed:
        listed = set(named[: len(concealed)])
        if truth['excitation'] == 'calibration':
            listed |= {*named, *(rival for e in report['effects'] for rival in e['alternatives'])}
        right = concealed <= listed
    else:
        healthy = ('consistent',) if truth['verdict'] else ('consistent', 'parameters_differ')
        right = not named and (bool(allowed) or report['verdict'] in healthy)
    numbers = []
    for effect in report['effects']:
        for key, value in truth['comparable'].get(effect['id'], {}).items():
            found = effect['parameters'].get(key)
            said = '{value:.4g} [{low:.4g}, {high:.4g}]'.format(**found) if found else 'not given'
            numbers.append(f'{effect["id"]}.{key}: true {value:.4g}, {said}')
    return Outcome(right, right and len(named) == len(concealed), tuple(numbers))


def _named(report: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(effect['id'] for effect in report['effects']))


def _worst(report: Mapping[str, Any]) -> str:
    """Largest misfit of the second recording over noise: as described, refitted, improved."""
    fit = report['fit'].get('validation', {})
    worst = (
        max((signal['rmse_over_noise'] for signal in fit.get(rung, {}).values()), default=None)
        for rung in ('nominal', 'refitted', 'augmented')
    )
    return ' '.join('-' if one is None else f'{one:.2f}' for one in worst)


def _if_there(path: Path) -> Path | None:
    return path if path.exists() else None


def _cpu_seconds() -> float:
    usages = (resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)
