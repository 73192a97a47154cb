"""Numbers by which mistakes are judged.

Derived once from recordings without any, seeds 2001 to 2240 of `endoscope bench mistakes`.
"""

from endoscope_explain.audit.misfit import Criteria

DERIVED = Criteria(
    scales={
        'shaft_position': (0.995, 1.0),
        'shaft_velocity': (0.914, 1.03),
        'shaft_effort': (0.581, 1.77),
        'tension': (0.592, 1.84),
        'bending': (0.0, 1.89),
    },
    usual={
        'shaft_position': 0.0125,
        'shaft_velocity': 0.0305,
        'shaft_effort': 0.117,
        'tension': 0.147,
        'bending': 0.24,
    },
    follows=0.0551,
    least_tension=-0.563,
    worth=4.86,
)
