"""How curves of models, and of what was measured, are drawn."""

from typing import Any

from endoscope_explain.report.numbers import MODELS

TIME = 'time (s)'

COLOUR = {
    'measured': 'actual',
    'nominal': 'curve-2',
    'refitted': 'curve-1',
    'augmented': 'curve-4',
    'gaussian_process': 'curve-3',
    'neural_network': 'curve-5',
}
"""Names of look.css."""

DASH: dict[str, tuple[float, ...]] = {
    'measured': (),
    'nominal': (),
    'refitted': (6.0, 4.0),
    'augmented': (9.0, 3.0, 2.0, 3.0),
}
"""Dashes let a curve that nearly coincides with another one be seen."""

LABEL = {'measured': 'measured', **MODELS}


def look(name: str) -> dict[str, Any]:
    """How the curve of a model, or of what was measured, is drawn."""
    return {'label': LABEL[name], 'colour': COLOUR[name], 'dash': DASH[name]}
