"""The README's table of all node parameters, made from what the nodes declare.

`python tests/parameter_table.py` prints it.
"""

import dataclasses
import importlib

from endoscope_nodes.topics import RECORDED

DECLARED = {
    'motor_driver': (
        ('motor_driver_node', 'MotorDriverParameters'),
        ('dynamixel_parameters', 'DynamixelParameters'),
    ),
    'load_cells': (('load_cells_node', 'LoadCellsParameters'),),
    'em_tracker': (('em_tracker_node', 'EmTrackerParameters'),),
    'compensator': (('compensator_parameters', 'CompensatorParameters'),),
    'controller': (('controller_node', 'ControllerParameters'),),
    'calibration': (('calibration_node', 'CalibrationParameters'),),
    'console': (('console_node', 'ConsoleParameters'),),
    'recorder': (('recorder_node', 'RecorderParameters'),),
    'replay': (('replay_node', 'ReplayParameters'),),
    'conductor': (('conductor_node', 'ConductorParameters'),),
}
"""Modules and dataclasses that hold the parameters of each node."""

HEADING = (
    '| node | parameter | default | allowed | unit | while running | what it does |',
    '|---|---|---|---|---|---|---|',
)


def rows() -> list[str]:
    """Return a line of Markdown for each parameter."""
    return [
        _row(node, field)
        for node, kinds in DECLARED.items()
        for module, kind in kinds
        for field in dataclasses.fields(
            getattr(importlib.import_module(f'endoscope_nodes.{module}'), kind)
        )
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
