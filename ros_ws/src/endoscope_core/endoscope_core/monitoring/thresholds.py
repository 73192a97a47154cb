"""Log-likelihood gains at which a change of each part is reported.

From 10 h of motion of unchanged rigs, by
`endoscope bench watch --derive --nominal 2101-2160`.
"""

THRESHOLDS = {
    'cell': 56.5,  # largest seen: 47.7
    'tracker': 198.0,  # largest seen: 71.2
    'wire': 42.6,  # largest seen: 17.7
    'sheath': 37.0,  # largest seen: 15.8
    'joint': 145.0,  # largest seen: 96.3
    'actuator': 19.0,  # largest seen: 19
}
FALSE_ALARMS_PER_HOUR = 0.1
"""Of motion, for which they are derived."""
