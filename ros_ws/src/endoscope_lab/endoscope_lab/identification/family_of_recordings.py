"""Identification of a rig from recordings in its tubes: fit and table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from endoscope_core.physics.family import TubeFamily
from endoscope_lab.identification.family_fit import (
    LUMPED,
    TubeRecording,
    figures,
    fit_family,
    misfit,
    read,
)

LEFT = """\
left, rms: angle in deg, tensions of both wires in N; 1.3 cycles (fitted) | the rest (judged)
tube   family                            friction lumped at the ends"""
BESIDE = """\

simulated/recorded: loop width, RMSE to the command, range of the angle in deg; extremes of tension
in N; loop 1 begins a quarter cycle after the start, loop 2 is the second cycle
tube loop       width         RMSE             angle from, to               wire 1 from, to      \
wire 2 from, to"""
RECORDED = {
    'recordings': 'flexible endoscopic surgery robot, tube bent by 0, 60, 120, 180, 240 deg',
    'paper': 'Nho, Baek et al., ViO-Com, IEEE RA-L 2021',
    'repository': 'nhoyh/hysteresis_compensation_ROS, commit 7c00843, optimization/selected',
    'licence': 'none stated; no recording is part of this project',
}
_RAD = np.pi / 180.0


@dataclass(frozen=True)
class IdentifiedFamily:
    """A family, and a lumped plant fitted in the same way."""

    family: TubeFamily
    lumped: TubeFamily


def identified(
    recordings: Sequence[TubeRecording],
    seed: int,
    command: str,
    report: Callable[[str], None],
) -> IdentifiedFamily:
    """Fit a family and a lumped plant to the first 1.3 cycles."""
    first = [recording.until(recording.fitted.stop) for recording in recordings]
    report(f'{len(first)} tubes: the family')
    family = fit_family(first, seed=seed)
    report('friction lumped at the ends')
    lumped = fit_family(first, friction_profile=LUMPED, seed=seed)
    left: dict[str, Any] = {
        f'{_bend(recording)} deg': [
            [round(misfits.angle / _RAD, 2), *np.round(misfits.tension, 2).tolist()]
            for misfits in (
                misfit(family, recording, part) for part in (recording.fitted, recording.judged)
            )
        ]
        for recording in recordings
    }
    provenance = {
        **RECORDED,
        'date': datetime.now(UTC).date().isoformat(),
        'command': command,
        'fitted_on': '1.3 cycles of every tube, all together',
        'left (deg and N of both wires, rms; 1.3 cycles, the rest)': left,
    }
    return IdentifiedFamily(replace(family, provenance=provenance), lumped)


def table(recordings: Sequence[TubeRecording], found: IdentifiedFamily) -> str:
    """Residuals of each tube, and its figures, simulated over recorded."""
    lines = [LEFT]
    for recording in recordings:
        plants = []
        for family in (found.family, found.lumped):
            cycles = [
                misfit(family, recording, part) for part in (recording.fitted, recording.judged)
            ]
            plants.append(
                ' | '.join(
                    f'{m.angle / _RAD:4.2f} {m.tension[0]:.2f} {m.tension[1]:.2f}' for m in cycles
                )
            )
        lines.append(f'{_bend(recording):4d}   {"     ".join(plants)}')
    lines.append(BESIDE)
    for recording in recordings:
        angle, tension = read(found.family, recording.bend, recording.desired, recording.tick)
        for number in (1, 2):
            part = settled(recording, number)
            pair = [
                figures(recording.desired[part], a[part], t[part])
                for a, t in ((angle, tension), (recording.angle, recording.tension))
            ]
            made, seen = pair
            cells = [
                _beside(made.loop_width / _RAD, seen.loop_width / _RAD, 1),
                _beside(made.rmse / _RAD, seen.rmse / _RAD, 1),
                _beside(made.least_angle / _RAD, seen.least_angle / _RAD, 1),
                _beside(made.most_angle / _RAD, seen.most_angle / _RAD, 1),
            ]
            for wire in range(2):
                cells.append(_beside(made.least_tension[wire], seen.least_tension[wire], 2))
                cells.append(_beside(made.most_tension[wire], seen.most_tension[wire], 2))
            lines.append(f'{_bend(recording):4d}   {number}   ' + '  '.join(cells))
    return '\n'.join(lines)


def settled(recording: TubeRecording, number: int) -> slice:
    """A whole loop: the second cycle, or one cycle from the end of the first quarter."""
    if number > 1:
        return recording.cycle(number)
    # The first quarter of a recording starts from rest and is not on the loop.
    quarter = recording.cycles[1] // 4
    return slice(quarter, recording.cycles[1] + quarter)


def _bend(recording: TubeRecording) -> int:
    return round(recording.bend / _RAD)


def _beside(made: float, seen: float, digits: int) -> str:
    return f'{made:.{digits}f}/{seen:.{digits}f}'.rjust(11)
