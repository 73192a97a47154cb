"""`endoscope bench watch`: change detection, the share of detected changes and false alarms."""

import argparse
import math
import time
from collections.abc import Sequence

import numpy as np

from endoscope_core.atomic_output import write_text
from endoscope_core.monitoring import Part
from endoscope_core.monitoring.thresholds import THRESHOLDS
from endoscope_lab.bench import (
    chosen,
    keep_row,
    report,
    rows_so_far,
    side_by_side,
    table_head,
    table_row,
)
from endoscope_lab.watch import cost
from endoscope_lab.watch.changing_rig import KINDS, SEGMENT_S, Watched, watched

_PER_HOUR = 0.1
"""False alarms per hour of motion for which the thresholds are derived, all parts together."""
_HOURS = SEGMENT_S / 3600.0
_TAIL = 0.2
"""Share of the segments whose largest gains are in the tail that is fitted."""


def run(args: argparse.Namespace) -> int:
    """Print the table, or the thresholds; return 0."""
    if args.cost:
        return cost.run()
    # Without alarms where thresholds are derived, so that each rig is watched to its end.
    thresholds = dict.fromkeys(map(str, Part), math.inf) if args.derive else THRESHOLDS
    kinds = () if args.derive else tuple(chosen('change', args.only, KINDS))
    rows = {(row.kind, row.seed): row for row in rows_so_far(args.json, Watched)}
    cases = _in_turn([(kind, seed) for seed in args.seeds for kind in kinds], args.nominal)
    calls = [(*case, thresholds) for case in cases if case not in rows]
    ends = time.monotonic() + args.within
    for (kind, seed, _), future in side_by_side(args.jobs, watched, calls):
        rows[kind, seed] = future.result()
        keep_row(args.json, rows[kind, seed])
        if time.monotonic() > ends:
            report(f'ended after {args.within:g} s with {len(rows)} of {len(cases)} rigs')
            break
    done = [rows[case] for case in sorted(cases, key=lambda case: case[1]) if case in rows]
    if args.derive:
        source = derived(done)
        print(source)
        if args.write:
            write_text(args.write, source)
    else:
        _print(done, kinds)
    return 0


def _in_turn(changes: Sequence[tuple[str, int]], nominal: Sequence[int]) -> list[tuple[str, int]]:
    """Cases of both sorts in proportion, so that a run that ends early has some of each."""
    places = [(k / len(changes), case) for k, case in enumerate(changes)]
    places += [(k / len(nominal), ('', seed)) for k, seed in enumerate(nominal)]
    return [case for _, case in sorted(places, key=lambda each: each[0])]


def derived(rows: Sequence[Watched]) -> str:
    """Source of the module of thresholds, from nominal motion."""
    # A log-likelihood ratio has an exponential tail where nothing changes (Wilks, Ann. Math. Stat.
    # 9, 1938), and what models leave scales it: beyond a high level the largest gains of segments
    # are exponential (peaks over threshold: Coles, Statistical Modeling of Extreme Values, 2001).
    # Each part has an equal share of the false alarms. Its threshold is that of a likelihood ratio
    # at least (Ville, Etude critique de la notion de collectif, 1939).
    share = _PER_HOUR * _HOURS / len(Part)
    count, lines = max(1, round(_TAIL * len(rows))), list[str]()
    for part in Part:
        gains = np.sort([row.largest[part] for row in rows])
        level = float(gains[max(0, len(gains) - count - 1)])
        scale = float(np.mean(gains[-count:])) - level
        largest = float(gains[-1])
        # The largest gain, in which a heavier tail would show, must raise no alarm: a hundredth
        # above it, so that rounding does not come down to it.
        least = max(1.01 * largest, -math.log(share))
        reached = level + scale * math.log(count / len(rows) / share)
        threshold = float(f'{max(reached, least):.3g}')
        lines.append(f"    '{part}': {threshold!r},  # largest seen: {largest:.3g}")
    first, last = rows[0].seed, rows[-1].seed
    return (
        '"""Log-likelihood gains at which a change of each part is reported.\n\n'
        f'From {len(rows) * _HOURS:g} h of motion of unchanged rigs, by\n'
        f'`endoscope bench watch --derive --nominal {first}-{last}`.\n"""\n\n'
        + '\n'.join(['THRESHOLDS = {', *lines, '}'])
        + f'\nFALSE_ALARMS_PER_HOUR = {_PER_HOUR}\n"""Of motion, for which they are derived."""\n'
    )


def _print(rows: Sequence[Watched], kinds: Sequence[str]) -> None:
    print(table_head('change', 'rigs', 'reported within 10 s', 'right stage', 'reported before it'))
    for kind in (*kinds, 'all'):
        of = [row for row in rows if row.kind and kind in (row.kind, 'all')]
        counts = [sum(getattr(row, name) for row in of) for name in ('reported', 'right', 'early')]
        print(table_row(kind, len(of), *counts))
    nominal = [row for row in rows if not row.kind]
    false = sum(row.early for row in nominal)
    print(f'false alarms: {false} in {len(nominal) * _HOURS:.1f} h of nominal motion')
    for row in rows:
        if row.early or (row.kind and not row.right):
            alarms = '; '.join(row.alarms) or 'no alarm'
            print(f'{row.kind or "nominal"}, seed {row.seed}: {alarms}')
