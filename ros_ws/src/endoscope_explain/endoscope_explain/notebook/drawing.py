"""Tables and pictures as notebooks show them, without other files."""

import base64
import io
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTSIDE = {'loc': 'upper left', 'bbox_to_anchor': (1.0, 1.0), 'fontsize': 7, 'frameon': False}
"""Where a legend hides no curve."""


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return the same as an HTML table."""
    lines = [''.join(f'<th>{escape(cell)}</th>' for cell in head)]
    lines += [''.join(f'<td>{escape(cell)}</td>' for cell in row) for row in rows]
    return '<table>' + ''.join(f'<tr>{line}</tr>' for line in lines) + '</table>'


def embedded(figure: 'Figure') -> str:
    """Return a picture as an HTML element that holds all of it."""
    content = io.BytesIO()
    # As pixels: a minute at 1 kHz is ten thousand times as large in vectors.
    figure.savefig(content, format='png', dpi=90)
    picture = base64.b64encode(content.getvalue()).decode()
    return f'<img style="max-width:100%" src="data:image/png;base64,{picture}">'
