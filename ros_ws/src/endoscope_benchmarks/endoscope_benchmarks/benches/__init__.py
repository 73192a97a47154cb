"""The benches of `endoscope bench`, one module each, of the same form as the subcommands."""

BENCHES: tuple[str, ...] = (
    'graph',
    'console',
    'pauses',
    'busy',
    'recorder',
    'explain',
    'concealed',
    'criteria',
    'mistakes',
    'recordings',
    'limits',
    'real',
    'peers',
    'simulate',
    'calibration_rate',
    'papers',
    'motor_bus',
    'motor_faults',
    'faults',
    'files',
)
