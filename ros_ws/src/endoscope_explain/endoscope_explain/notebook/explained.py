"""What an explanation found, to view, draw and work with."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from endoscope_core.atomic_output import atomic_directory
from endoscope_core.physics.description import PlantDescription
from endoscope_explain.case import ExplainedCase
from endoscope_explain.explanation import NamedEffect, NominalEstimate
from endoscope_explain.notebook.signals import OUTSIDE, embedded
from endoscope_explain.observe.predicted_signals import RecordedView, view
from endoscope_explain.report import sentences
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.numbers import PLANTS, Shown, numbers_of
from endoscope_explain.report.writing import report_mapping, write_report
from endoscope_pages import html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_EFFECTS = ('effect', 'joint', 'alternatives', 'number', 'value', '90 % interval', 'unit')


@dataclass(frozen=True)
class Explained:
    """An explained recording; prints itself as a table, in a notebook with a picture.

    Attributes
    ----------
    case : ExplainedCase
        Everything that is known about it.
    """

    case: ExplainedCase

    @property
    def verdict(self) -> str:
        """One of the words of `report.json`, such as `missing_physics`."""
        return str(self.case.verdict)

    @property
    def effects(self) -> tuple[NamedEffect, ...]:
        """What the simulation left out, most certain first."""
        return self.case.effects

    @property
    def parameters(self) -> Mapping[str, Mapping[str, NominalEstimate]]:
        """Refitted parameters of the plant, by joint and name."""
        return self.case.explanation.parameters

    @property
    def plant(self) -> PlantDescription:
        """The improved plant, which `simulate` takes."""
        return self.case.plant

    @cached_property
    def report(self) -> dict[str, Any]:
        """What `report.json` says."""
        return report_mapping(self.case)

    @cached_property
    def predicted(self) -> RecordedView:
        """Every signal as measured, and as the described plant and the improved one predict it."""
        explanation = self.case.explanation
        best = 'refitted' if explanation.augmented == explanation.refitted else 'augmented'
        plants = {'nominal': explanation.nominal, best: explanation.augmented}
        return view(self.case.recording, plants)

    def page(self) -> str:
        """Return `report.html`."""
        return html_page(self.case)

    def save(self, folder: str | Path) -> Path:
        """Write report.json, report.html and plant.yaml to a new or empty folder; return it.

        Raises
        ------
        OutputError
            There is something in it.
        """
        with atomic_directory(folder) as partial:
            write_report(self.case, partial)
        return Path(folder)

    def plot(self) -> 'Figure':
        """Draw each joint's angle: as measured, and by the described plant and the improved one.

        Returns
        -------
        matplotlib.figure.Figure
            A row for each joint, with the error in degrees below it; empty where none was read.
        """
        from matplotlib.figure import Figure

        bending = [s for s in self.predicted.signals.values() if s.quantity == 'bending']
        figure = Figure(figsize=(9.0, 3.6 * len(bending) + 0.4), layout='constrained')
        if not bending:
            return figure
        ratios = [2.0, 1.0] * len(bending)
        axes = figure.subplots(
            2 * len(bending), 1, sharex=True, squeeze=False, height_ratios=ratios
        )[:, 0].tolist()
        for angle, error, signal in zip(axes[::2], axes[1::2], bending, strict=True):
            angle.plot(signal.time, np.degrees(signal.measured), c='#9aa5b1', lw=2.4)
            for (name, predicted), style, colour in zip(
                signal.predicted.items(), ('-', '--'), ('#b3261e', '#136b4f'), strict=True
            ):
                wrong = np.degrees(predicted - signal.measured)
                angle.plot(signal.time, np.degrees(predicted), style, c=colour, lw=1.1)
                rmse = float(np.sqrt(np.mean(wrong**2)))
                error.plot(
                    signal.time, wrong, c=colour, lw=0.9, label=f'{PLANTS[name]}: {rmse:.2f} rms'
                )
            angle.legend(['measured', *(PLANTS[name] for name in signal.predicted)], **OUTSIDE)
            angle.set_ylabel(f'{signal.joint} [deg]')
            error.set_ylabel('error [deg]')
            error.legend(**OUTSIDE)
            for axis in (angle, error):
                axis.grid(alpha=0.3)
        axes[-1].set_xlabel('time [s]')
        return figure

    def _effect_rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = []
        for effect in self.effects:
            named = (sentences.label(effect), effect.joint, ', '.join(effect.alternatives) or '-')
            for one in numbers_of(effect) or [Shown('-', '-', '-', '-', '-')]:
                rows.append((*named, one.name, one.value, f'{one.low} to {one.high}', one.unit))
                named = ('', '', '')
        return rows

    def __repr__(self) -> str:
        name = self.case.recording.name
        headline = sentences.HEADLINES[self.case.verdict]
        return f'{name}: {self.verdict}. {headline}.\n{sentences.told(self.case)}'

    def _repr_html_(self) -> str:
        name = escape(self.case.recording.name)
        parts = [
            f'<p><b>{name}: {sentences.HEADLINES[self.case.verdict]}</b> ({self.verdict})</p>',
            f'<p>{escape(sentences.verdict_sentence(self.case))}</p>',
            *(
                f'<p>{escape(said)}</p>'
                for said in (*sentences.reservations(self.case), *sentences.not_shown(self.case))
            ),
        ]
        if self.effects:
            parts.append(html_table(_EFFECTS, self._effect_rows()))
        fits = sentences.fits_table(self.case)
        if fits:
            parts.append('<p>rmse / noise, on samples held out</p>')
            parts.append(html_table(*fits))
            parts.append(embedded(self.plot()))
        parts.append(f'<p>{escape(sentences.next_step(self.case))}</p>')
        return ''.join(parts)
