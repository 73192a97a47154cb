"""Log-likelihood gains at which a change of each part is reported.

From 24 h of motion of unchanged rigs, by
`endoscope bench watch --derive --nominal 2101-2244`.
"""

THRESHOLDS = {
    'cell': 75.5,  # largest seen: 61.7
    'tracker': 145.0,  # largest seen: 118
    'wire': 23.7,  # largest seen: 19.6
    'sheath': 32.3,  # largest seen: 30.2
    'joint': 159.0,  # largest seen: 157
    'actuator': 22.2,  # largest seen: 19
}
FALSE_ALARMS_PER_HOUR = 0.1
"""Of motion, for which they are derived."""
