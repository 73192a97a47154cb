"""Which load cell an effect is of."""

from endoscope_core.physics.effect import Parameter

ONE_CELL = Parameter(
    'wire',
    '-',
    0.0,
    1.0,
    0.0,
    choices=(0.0, 1.0),
    words=('the cell of the positive wire', 'the cell of the negative wire'),
)
"""The cell of one wire."""
