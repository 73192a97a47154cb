"""Which effects there are to conceal, and which of them go together."""

import numpy as np

from endoscope_explain.generator.conceal_in_actuator import ACTUATOR_EFFECTS
from endoscope_explain.generator.conceal_in_joint import JOINT_EFFECTS
from endoscope_explain.generator.conceal_in_readings import READING_EFFECTS
from endoscope_explain.generator.conceal_in_transmission import TRANSMISSION_EFFECTS
from endoscope_explain.generator.conceal_outside_catalogue import OUTSIDE_EFFECTS
from endoscope_explain.generator.concealment import Effect

EFFECTS: dict[str, Effect] = {
    effect.id: effect
    for effect in (*ACTUATOR_EFFECTS, *TRANSMISSION_EFFECTS, *JOINT_EFFECTS, *READING_EFFECTS)
}
OUTSIDE: dict[str, Effect] = {effect.id: effect for effect in OUTSIDE_EFFECTS}
# A chain of segments has no law of its own for these; the foreign rig is a chain.
NOT_IN_A_CHAIN = frozenset(
    {
        'distributed_friction',
        'presliding_shape',
        'joint_backlash',
        'viscous_friction',
        'tension_presliding',
    }
)
# Two that hide each other.
INCOMPATIBLE = tuple(
    frozenset(pair)
    for pair in (
        ('wire_slack', 'pretension_loss'),
        ('wire_slack', 'wire_stiffening'),
        ('joint_stop', 'contact'),
        ('joint_backlash', 'joint_inertia'),
        ('gravity', 'contact'),
        ('gear_backlash', 'joint_backlash'),
        ('clock_skew', 'tracker_delay'),
        ('tracker_bias', 'tracker_distortion'),
        ('load_cell_saturation', 'load_cell_gain'),
        ('load_cell_gain', 'load_cell_crosstalk'),
        ('transport_delay', 'actuator_lag'),
        ('rate_limit', 'actuator_lag'),
        ('configuration_change', 'friction_run_in'),
        ('stribeck_friction', 'friction_run_in'),
    )
)


def compatible(first: str, other: str) -> bool:
    """Whether two different effects of the catalogue can be told apart in one rig."""
    chained = {first, other} - {'distributed_friction'}
    if len(chained) == 1 and chained <= NOT_IN_A_CHAIN:
        return False
    return frozenset((first, other)) not in INCOMPATIBLE


def require_drawable(effects: tuple[str, ...], stratum: str) -> None:
    """Refuse effects that a rig of this stratum cannot hold.

    Raises
    ------
    ValueError
        Names them.
    """
    for k, first in enumerate(effects):
        if stratum == 'foreign' and first in NOT_IN_A_CHAIN:
            raise ValueError(f'{first} cannot be concealed in a foreign rig, which is a chain')
        for other in effects[k + 1 :]:
            if not compatible(first, other):
                raise ValueError(f'{first} and {other} cannot be concealed together')


def choose(stratum: str, rng: np.random.Generator) -> tuple[str, ...]:
    """Draw the ids that a case of this stratum conceals."""
    if stratum == 'null':
        return ()
    if stratum == 'outside':
        return (str(rng.choice(list(OUTSIDE))),)
    names = [n for n in EFFECTS if stratum != 'foreign' or n not in NOT_IN_A_CHAIN]
    if stratum != 'pair':
        return (str(rng.choice(names)),)
    while True:
        first, other = (str(name) for name in rng.choice(names, 2, replace=False))
        if compatible(first, other):
            return first, other
