"""Plots of what tube configurations held out say of a classifier, each a string of SVG."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from endoscope_core.atomic_output import atomic_directory
from endoscope_core.classifier.grouped_folds import CrossValidation
from endoscope_core.classifier.size_training import SizeValidation
from endoscope_core.dataset import CLASSES_DEG
from endoscope_core.pages.still_pictures import GUILTY, INK, STYLE, svg

_BLUE = '#2f6fb7'
_LEVELS = np.linspace(0.05, 0.99, 48)


def confusion_figure(validation: CrossValidation, name: str) -> str:
    """How many recordings of each true class were taken for each class."""
    counts = validation.confusion
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.2, 3.9), layout='constrained')
        axis = figure.subplots()
        axis.grid(visible=False)
        axis.imshow(counts, cmap='Blues', vmin=0, vmax=1.4 * np.max(counts))
        for row, column in np.argwhere(counts):
            wrong = row != column
            axis.text(
                column,
                row,
                str(counts[row, column]),
                ha='center',
                va='center',
                color=GUILTY if wrong else INK,
            )
        labels = [str(size) for size in CLASSES_DEG]
        axis.set_xticks(range(len(labels)), labels)
        axis.set_yticks(range(len(labels)), labels)
        axis.set_xlabel('named class (deg)')
        axis.set_ylabel('true class (deg)')
        axis.set_title(f'{name}: {100.0 * validation.mean_accuracy:.1f} % right')
        return svg(figure)


def intervals_figure(validation: SizeValidation, size: NDArray[np.float64]) -> str:
    """Errors by size (rad) with their 90 % intervals, and shares inside intervals of any level."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.4, 3.6), layout='constrained')
        errors, levels = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
        errors.errorbar(
            np.rad2deg(size),
            np.rad2deg(validation.error),
            yerr=np.rad2deg(validation.half_width),
            fmt='o',
            markersize=2.0,
            color=_BLUE,
            ecolor='#b9d0e8',
            elinewidth=0.8,
        )
        errors.axhline(0.0, color=INK, linewidth=0.8)
        errors.set_xlabel('true backlash size (deg)')
        errors.set_ylabel('error of the regressed size (deg)')
        errors.set_title('tube configurations held out')
        shares = [100.0 * validation.share_within(float(level)) for level in _LEVELS]
        levels.plot([0, 100], [0, 100], color='#9aa5b1', linewidth=0.8, linestyle=':')
        levels.plot(100.0 * _LEVELS, shares, color=_BLUE, linewidth=1.4)
        levels.set_xlabel('promised share (%)')
        levels.set_ylabel('sizes within their interval (%)')
        levels.set_aspect('equal')
        levels.set_title('calibration of intervals')
        return svg(figure)


def save_figures(folder: Path, figures: Mapping[str, str]) -> None:
    """Write NAME.svg for each figure to a new folder, whole or not at all.

    Raises
    ------
    OutputExistsError
        If there is something at `folder` already.
    """
    with atomic_directory(folder) as partial:
        for name, text in figures.items():
            (partial / f'{name}.svg').write_text(text, encoding='utf-8')
