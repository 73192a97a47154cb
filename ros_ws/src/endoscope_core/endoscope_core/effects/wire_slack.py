"""`wire_slack`: dead length before a wire carries load, beyond what pretension takes up."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'wire_slack',
    Stage.TRANSMISSION,
    physics='Each wire has to be pulled through a dead length before it carries load.',
    equation='T = max(0, T0 + k (s - length_m)): truly slack at rest where k length_m > T0',
    source='Slack of antagonistic tendons: Palli, Melchiorri, IEEE ICRA 2006; Do et al., '
    'Mechatronics 24, 2014',
    parameters=(
        EffectParameter('length_m', 'm', 0.0, 0.02, 0.0035, off=0.0, starts=(0.0028, 0.0045)),
    ),
)
ON = DEFINITION.flag
LENGTH = DEFINITION.first_parameter


@compiled
def taut_stretch(parameters: Array, stretch: float) -> float:
    """Stretch in m that is left once the dead length has been taken up."""
    return stretch - parameters[LENGTH]
