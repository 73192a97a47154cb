"""The papers' tables beside ours, one module each.

A module here has ``TITLE: str`` and ``rows(settings: PapersBench) -> list[Row]``; `TABLES` names
them in the order of printing. Heavy imports belong into `rows`.
"""

TABLES: tuple[str, ...] = (
    'tension_by_shape',
    'classifiers',
    'nearest_class',
    'colon_shapes',
    'compensators',
    'reach',
    'changing_tube',
    'calibration_time',
    'real_sizes',
    'real_recordings',
)
