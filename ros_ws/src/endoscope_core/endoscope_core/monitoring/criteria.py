"""Gains of the likelihood's logarithm at which a change of each part is told.

From 10 h of motion of rigs that stay as they are, by
`endoscope bench watch --derive --nominal 2001-2060`.
"""

THRESHOLDS = {
    'cell': 50.1,  # largest seen: 41.9
    'tracker': 165.0,  # largest seen: 69.6
    'wire': 37.9,  # largest seen: 15
    'sheath': 16.5,  # largest seen: 16.5
    'joint': 105.0,  # largest seen: 56.9
    'actuator': 11.4,  # largest seen: 11.4
}
FALSE_ALARMS_PER_HOUR = 0.1
"""Of motion, for which they are derived."""
