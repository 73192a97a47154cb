"""Gains of the likelihood's logarithm at which a change of each part is told.

First guesses: `endoscope bench watch --derive --write` derives them from nominal motion.
"""

THRESHOLDS = {
    'cell': 80.0,
    'tracker': 80.0,
    'wire': 80.0,
    'sheath': 80.0,
    'joint': 80.0,
    'actuator': 80.0,
}
