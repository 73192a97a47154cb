"""The figures by which explanations are judged, from the outcomes of many cases."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from endoscope_explain.benchmark.outcome import Outcome

WELL = ('consistent', 'parameters_differ')
BINS = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)
NOISE_FACTOR = 1.15


@dataclass(frozen=True)
class Figure:
    """One line of the table.

    Attributes
    ----------
    name, value, wanted : str
        As printed.
    reached : bool or None
        None where no case bears on it.
    """

    name: str
    value: str
    wanted: str
    reached: bool | None


@dataclass(frozen=True)
class CalibrationBin:
    """Effects that were reported with similar probabilities.

    Attributes
    ----------
    low, high : float
    count : int
    mean : float
        Mean probability reported.
    right : float
        Share of them that were concealed.
    """

    low: float
    high: float
    count: int
    mean: float
    right: float


def figures(outcomes: Sequence[Outcome]) -> list[Figure]:
    """Return the table's lines.

    Parameters
    ----------
    outcomes : sequence of Outcome

    Returns
    -------
    list of Figure
    """
    single = _of(outcomes, 'single', 'commissioning')
    calibration = _of(outcomes, 'single', 'calibration')
    inside = [o for o in outcomes if o.stratum in ('single', 'pair', 'weak', 'foreign')]
    return [
        _share(
            'effect named first, single effect, commissioning motion', single, named_first, 0.98
        ),
        _share('stage right', single, stage_right, 0.98),
        _share('9 s sinusoid only: truth among first and alternatives', calibration, listed, 0.95),
        _mean_listed(calibration),
        _share('both effects of a pair named', _of(outcomes, 'pair'), both_named, 0.90),
        _share(
            'effects at a tenth of usual strength: named first',
            _of(outcomes, 'weak'),
            named_first,
            0.85,
        ),
        _share(
            'nothing concealed: consistent or parameters_differ',
            _of(outcomes, 'null'),
            lambda o: o.verdict in WELL,
            0.98,
        ),
        _share(
            'outside the catalogue: unknown_physics',
            _of(outcomes, 'outside'),
            lambda o: o.verdict == 'unknown_physics',
            0.85,
        ),
        _share(
            'a catalogue case called unknown',
            inside,
            lambda o: o.verdict == 'unknown_physics',
            0.05,
            most=True,
        ),
        _share(
            'foreign rig, against its baseline: named first',
            _of(outcomes, 'foreign'),
            named_first,
            None,
        ),
        *_parameters(inside),
        *_second([o for o in outcomes if o.stratum == 'single']),
        _calibration(outcomes),
    ]


def named_first(outcome: Outcome) -> bool:
    """Tell whether the concealed effect is named first."""
    return bool(outcome.named) and outcome.named[0].id in outcome.concealed


def stage_right(outcome: Outcome) -> bool:
    """Tell whether the first place reported is of the concealed effect's stage."""
    stages = {item['stage'] for item in outcome.truth['concealed']}
    # The catalogue has this effect in either place.
    if 'presliding_shape' in outcome.concealed:
        stages |= {'transmission', 'joint'}
    return outcome.stage in stages


def listed(outcome: Outcome) -> bool:
    """Tell whether every concealed effect is named or listed as an alternative."""
    return set(outcome.concealed) <= outcome.listed()


def both_named(outcome: Outcome) -> bool:
    """Tell whether the concealed effects are those named first."""
    return set(outcome.concealed) <= set(outcome.ids()[: len(outcome.concealed)])


def calibration_curve(outcomes: Iterable[Outcome]) -> list[CalibrationBin]:
    """Compare reported probabilities with how often they were right.

    Parameters
    ----------
    outcomes : iterable of Outcome

    Returns
    -------
    list of CalibrationBin
        Those that are not empty.
    """
    pairs = np.array(
        [(effect.probability, effect.id in o.concealed) for o in outcomes for effect in o.named],
        dtype=float,
    ).reshape(-1, 2)
    curve = []
    for low, high in pairwise(BINS):
        inside = (pairs[:, 0] > low) & (pairs[:, 0] <= high)
        if inside.any():
            mean, right = pairs[inside].mean(axis=0)
            curve.append(CalibrationBin(low, high, int(inside.sum()), float(mean), float(right)))
    return curve


def confusions(outcomes: Iterable[Outcome]) -> dict[tuple[str, str], int]:
    """Count what was named first where one effect was concealed.

    Parameters
    ----------
    outcomes : iterable of Outcome

    Returns
    -------
    dict of (concealed, named) to int
        `named` is the verdict where no effect was named.
    """
    counts: dict[tuple[str, str], int] = {}
    for o in outcomes:
        if len(o.concealed) == 1:
            key = (o.concealed[0], o.named[0].id if o.named else o.verdict)
            counts[key] = counts.get(key, 0) + 1
    return counts


def peers_named_first(outcomes: Iterable[Outcome]) -> dict[str, tuple[int, int]]:
    """Count how often each peer, and `explain` on the same cases, named the concealed effect.

    Parameters
    ----------
    outcomes : iterable of Outcome

    Returns
    -------
    dict of str to (int, int)
        Right, and asked.
    """
    asked = [o for o in outcomes if o.peers]
    counts = {'explain': (sum(named_first(o) for o in asked), len(asked))}
    for peer in dict.fromkeys(name for o in asked for name in o.peers):
        right = sum(o.peers[peer] in o.concealed for o in asked)
        counts[peer] = (right, len(asked))
    return counts


def _of(outcomes: Iterable[Outcome], stratum: str, motion: str | None = None) -> list[Outcome]:
    return [o for o in outcomes if o.stratum == stratum and motion in (None, o.motion)]


def _share(
    name: str,
    cases: Sequence[Outcome],
    right: Callable[[Outcome], bool],
    wanted: float | None,
    *,
    most: bool = False,
) -> Figure:
    bound = '' if wanted is None else f'{"at most" if most else "at least"} {100 * wanted:.0f} %'
    if not cases:
        return Figure(name, 'no case', bound, None)
    count = sum(map(right, cases))
    share = count / len(cases)
    reached = None if wanted is None else (share <= wanted if most else share >= wanted)
    return Figure(name, f'{100 * share:.1f} % ({count} of {len(cases)})', bound, reached)


def _mean_listed(cases: Sequence[Outcome]) -> Figure:
    name, wanted = '9 s sinusoid only: ids listed on average', 'at most 3'
    if not cases:
        return Figure(name, 'no case', wanted, None)
    mean = float(np.mean([len(o.listed()) for o in cases]))
    return Figure(name, f'{mean:.2f}', wanted, mean <= 3.0)


def _parameters(cases: Sequence[Outcome]) -> list[Figure]:
    errors, covered = [], []
    for o in cases:
        for effect in o.named:
            for name, truth in o.truth['comparable'].get(effect.id, {}).items():
                if name not in effect.parameters:
                    errors.append(np.inf)
                    covered.append(False)
                    continue
                value, low, high = effect.parameters[name]
                errors.append(abs(value - truth) / abs(truth))
                covered.append(low <= truth <= high)
    if not errors:
        return [Figure('comparable parameters: median error', 'no case', 'at most 5 %', None)]
    median, share = float(np.median(errors)), float(np.mean(covered))
    return [
        Figure(
            'comparable parameters: median error',
            f'{100 * median:.2f} % of {len(errors)}',
            'at most 5 %',
            median <= 0.05,
        ),
        Figure(
            'comparable parameters: 90 % intervals that cover',
            f'{100 * share:.1f} % ({sum(covered)} of {len(covered)})',
            '85 to 95 %',
            0.85 <= share <= 0.95,
        ),
    ]


def _second(cases: Sequence[Outcome]) -> list[Figure]:
    def near_noise(o: Outcome, prefix: str) -> bool:
        fits = [v for k, v in o.second.items() if k.startswith(prefix)]
        return all(augmented <= NOISE_FACTOR * noise for _, augmented, noise in fits)

    def worse(o: Outcome) -> bool:
        def total(column: int) -> float:
            return sum((fit[column] / fit[2]) ** 2 for fit in o.second.values())

        return total(1) > total(0)

    title = 'second recording (of joints moved): {} within 1.15 x noise'
    return [
        _share(title.format('angles'), cases, lambda o: near_noise(o, 'slave'), 0.90),
        _share(title.format('angles and tensions'), cases, lambda o: near_noise(o, ''), 0.90),
        _share('second recording: worse than nominal', cases, worse, 0.0, most=True),
    ]


def _calibration(outcomes: Sequence[Outcome]) -> Figure:
    name, wanted = 'probability: mean distance from the share that is right', 'at most 0.05'
    curve = calibration_curve(outcomes)
    if not curve:
        return Figure(name, 'no case', wanted, None)
    total = sum(b.count for b in curve)
    distance = sum(b.count * abs(b.mean - b.right) for b in curve) / total
    return Figure(name, f'{distance:.3f} of {total}', wanted, distance <= 0.05)
