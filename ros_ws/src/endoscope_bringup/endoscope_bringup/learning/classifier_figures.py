"""Plot of the training of a classifier, a string of SVG."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from endoscope_core.atomic_output import atomic_directory
from endoscope_core.pages.still_pictures import STYLE, svg

_BLUE = '#2f6fb7'


def training_figure(curve: Sequence[tuple[int, float]]) -> str:
    """Mean loss over the steps of a training."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(5.2, 3.2), layout='constrained')
        axis = figure.subplots()
        steps, losses = zip(*curve, strict=True)
        axis.plot(steps, losses, color=_BLUE, marker='o', markersize=2.5, linewidth=1.4)
        axis.set_xlabel('step')
        axis.set_ylabel('mean loss of a recording')
        axis.set_title('training of the 1D-CNN')
        return svg(figure)


def save_figures(folder: Path, figures: Mapping[str, str]) -> None:
    """Write NAME.svg for each figure to a new folder, whole or not at all."""
    with atomic_directory(folder) as partial:
        for name, text in figures.items():
            (partial / f'{name}.svg').write_text(text, encoding='utf-8')
