"""The README's table of all node parameters, made from what the nodes declare.

`python tests/parameter_table.py` prints it.
"""

import dataclasses

from endoscope_nodes.node_parameters import OF_NODE
from endoscope_nodes.topics import RECORDED

HEADING = (
    '| node | parameter | default | allowed | unit | while running | what it does |',
    '|---|---|---|---|---|---|---|',
)


def rows() -> list[str]:
    """Return a line of Markdown for each parameter."""
    return [
        _row(node, field)
        for node, kinds in OF_NODE.items()
        for kind in kinds
        for field in dataclasses.fields(kind)
    ]


def _row(node: str, field: dataclasses.Field) -> str:
    meta = field.metadata
    cells = (
        f'`{node}`',
        f'`{field.name}`',
        _default(field.default),
        _allowed(meta),
        meta['unit'],
        'yes' if meta['dynamic'] else '',
        meta['description'],
    )
    return '| ' + ' | '.join(cells) + ' |'


def _default(value: object) -> str:
    if value == RECORDED:
        return 'all of the interface'
    items = value if isinstance(value, tuple) else (value,)
    text = ', '.join(_one(item) for item in items)
    return f'`{text}`' if text else ''


def _one(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f'{value:.5g}'
    return str(value)


def _allowed(meta: dict) -> str:
    if meta['choices']:
        return ', '.join(filter(None, meta['choices']))
    if meta['low'] is None and meta['high'] is None:
        return ''
    low = '' if meta['low'] is None else f'{meta["low"]:.4g}'
    high = '' if meta['high'] is None else f'{meta["high"]:.4g}'
    return f'{low} … {high}'.strip()


if __name__ == '__main__':
    print('\n'.join((*HEADING, *rows())))
