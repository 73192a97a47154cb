"""The benches of `endoscope bench`, one module each, of the same form as the subcommands."""

BENCHES: tuple[str, ...] = (
    'graph',
    'recorder',
    'explain',
    'simulate',
    'compensation',
    'calibration_rate',
    'papers',
    'paper_tubes',
    'motor_bus',
    'motor_faults',
    'faults',
    'files',
)
