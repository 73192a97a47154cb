"""The chain from command to recording, drawn with the guilty stage marked."""

from collections.abc import Mapping, Sequence
from html import escape

STAGES = ('command', 'actuator', 'transmission', 'joint', 'sensing', 'recording')
TITLES = {
    'command': ('Command', 'motor/servo_jp'),
    'actuator': ('Servo', 'motor/measured_js'),
    'transmission': ('Wires, sheath', 'wires/measured_js'),
    'joint': ('Bending joint', 'the tip'),
    'sensing': ('Sensors', 'load cells, tracker'),
    'recording': ('Recording', 'clocks, samples'),
}
BOX, GAP, HEIGHT, TOP = 138, 26, 62, 8
LINE = 15
FITS = 22
"""Letters of a finding that fit between those of the neighbouring stages."""


def chain_svg(guilty: Mapping[str, Sequence[str]]) -> str:
    """Draw the chain.

    Parameters
    ----------
    guilty : mapping of stage to sequence of str
        What was found in it, in words.

    Returns
    -------
    str
        SVG.
    """
    width = len(STAGES) * BOX + (len(STAGES) - 1) * GAP + 4
    lines = {stage: _lines(words) for stage, words in guilty.items()}
    below = max((len(words) for words in lines.values()), default=0) * LINE + 10
    parts = [
        (
            f'<svg viewBox="0 0 {width} {TOP + HEIGHT + below}" role="img" '
            'aria-label="chain from command to recording" font-family="system-ui, sans-serif">'
        ),
        (
            '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
            'markerHeight="7" orient="auto"><path d="M0 0 L8 4 L0 8 z" fill="#627180"/></marker>'
            '</defs>'
        ),
    ]
    for index, stage in enumerate(STAGES):
        x = 2 + index * (BOX + GAP)
        parts.append(_box(stage, x, lines.get(stage)))
        if index:
            y = TOP + HEIGHT / 2
            parts.append(
                f'<line x1="{x - GAP + 2}" y1="{y}" x2="{x - 2}" y2="{y}" stroke="#627180" '
                'stroke-width="1.6" marker-end="url(#tip)"/>'
            )
    return ''.join(parts) + '</svg>'


def _lines(words: Sequence[str]) -> list[str]:
    """Findings with the joint on a line of its own where both are too long for one."""
    lines = []
    for text in words:
        finding, bracket, joint = text.partition(' (')
        lines += [text] if len(text) <= FITS else [finding, bracket.strip() + joint]
    return lines


def _box(stage: str, x: float, words: Sequence[str] | None) -> str:
    title, detail = TITLES[stage]
    marked = words is not None
    fill, edge, ink = (
        ('#b3261e', '#8c1d18', '#ffffff') if marked else ('#f5f7f9', '#c3ccd5', '#1f2933')
    )
    soft = '#ffe9e6' if marked else '#627180'
    middle = x + BOX / 2
    parts = [
        (
            f'<rect x="{x}" y="{TOP}" width="{BOX}" height="{HEIGHT}" rx="8" fill="{fill}" '
            f'stroke="{edge}" stroke-width="1.4"/>'
        ),
        (
            f'<text x="{middle}" y="{TOP + 27}" text-anchor="middle" font-size="15" '
            f'font-weight="600" fill="{ink}">{escape(title)}</text>'
        ),
        (
            f'<text x="{middle}" y="{TOP + 46}" text-anchor="middle" font-size="11.5" '
            f'fill="{soft}">{escape(detail)}</text>'
        ),
    ]
    for line, text in enumerate(words or ()):
        y = TOP + HEIGHT + (line + 1) * LINE + 2
        parts.append(
            f'<text x="{middle}" y="{y}" text-anchor="middle" font-size="12.5" '
            f'font-weight="600" fill="#b3261e">{escape(text)}</text>'
        )
    return ''.join(parts)
