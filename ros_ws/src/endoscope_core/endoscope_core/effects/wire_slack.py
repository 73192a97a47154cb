"""`wire_slack`: dead length before a wire carries load, beyond what pretension takes up."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'wire_slack',
    Stage.TRANSMISSION,
    physics='Each wire has to be pulled through a dead length before it carries load, or more load '
    'than at rest.',
    equation='T = max(0, T0 + k (d(s) - length_m)): truly slack at rest where k length_m > T0; '
    'd(s) = s (1 - (1 + |s / dead_zone_m|^sharpness)^(-1 / sharpness))',
    source='Slack of antagonistic tendons: Palli, Melchiorri, IEEE ICRA 2006; Do et al., '
    'Mechatronics 24, 2014; dead zone: Agrawal, Peine, Yao, IEEE Trans. Robot. 26(6), 2010',
    parameters=(
        EffectParameter('length_m', 'm', 0.0, 0.02, 0.0035, off=0.0, starts=(0.0, 0.0028, 0.0045)),
        EffectParameter('dead_zone_m', 'm', 0.0, 5e-3, 0.0, starts=(0.0, 5e-5, 5e-4)),
        EffectParameter('sharpness', '-', 1.0, 10.0, 3.0),
    ),
)
ON = DEFINITION.flag
LENGTH = DEFINITION.first_parameter
DEAD_ZONE = LENGTH + 1
SHARPNESS = LENGTH + 2


@compiled
def taut_stretch(parameters: Array, stretch: float) -> tuple[float, float]:
    """Stretch in m that is left once the dead length has been taken up, and its slope."""
    dead, sharpness = parameters[DEAD_ZONE], parameters[SHARPNESS]
    growth = 1.0
    if dead > 0.0:
        beyond = 1.0 + (abs(stretch) / dead) ** sharpness
        lost = beyond ** (-1.0 / sharpness)
        growth = 1.0 - lost / beyond
        stretch *= 1.0 - lost
    return stretch - parameters[LENGTH], growth
