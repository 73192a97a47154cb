"""`wire_slack`: dead length before a wire carries load, beyond what pretension takes up."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.hooks import LENGTH, hook

EFFECT = Effect(
    'wire_slack',
    Stage.TRANSMISSION,
    10,
    physics='Each wire has to be pulled through a dead length before it carries load, or more load '
    'than at rest.',
    equation='extension = integral of T / (k Phi) dphi = w(0) - w(Phi) + what T0 stretched - '
    'length_m, T = 0 where that is negative',
    source='Slack of antagonistic tendons: Palli, Melchiorri, IEEE ICRA 2006; Do et al., '
    'Mechatronics 24, 2014; dead zone: Agrawal, Peine, Yao, IEEE Trans. Robot. 26(6), 2010',
    parameters=(
        Parameter('length_m', 'm', 0.0, 0.02, 5e-4, off=0.0, starts=(2e-4, 6e-4, 1.2e-3, 2e-3)),
    ),
)
(DEAD_LENGTH,) = EFFECT.places


@hook(EFFECT, LENGTH)
@compiled
def dead_length(p: Array, x: Array, wire: int, time: float) -> float:
    """What each wire has too much of, m."""
    return p[DEAD_LENGTH]
