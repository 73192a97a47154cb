"""`distributed_friction`: friction acts along the sheath; motion has to travel through it."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import SLOTS

NODES = 8
"""Nodes along each wire where nothing is said of their number."""
MOST_NODES = 12

DEFINITION = define(
    'distributed_friction',
    Stage.TRANSMISSION,
    physics='Friction acts all along the sheath: motion reaches the joint only after the sliding '
    'front has travelled through it.',
    equation='n nodes along each wire, T_i exp(-phi_i z_i / 2) = T_(i+1) exp(phi_i z_i / 2), '
    'phi_i = share phi / n, each with its own Dahl z_i; springs between them, and at both ends '
    'one that has free_end of the length',
    source='Kaneko et al., IEEE ICRA 1991; Palli, Borghesan, Melchiorri, IEEE Trans. Robot. '
    '28(2), 2012 (lumped chain)',
    parameters=(
        EffectParameter('share', '-', 0.0, 1.0, 1.0, off=0.0, starts=(0.15, 0.7)),
        EffectParameter('free_end', '-', 0.01, 0.4, 0.0625),
        EffectParameter('nodes', '-', 2, MOST_NODES, NODES, counted=True),
    ),
)
ON = DEFINITION.flag
SHARE = DEFINITION.first_parameter
FREE_END = SHARE + 1
COUNT = SHARE + 2

STRETCH = 0
"""Elongations in m of the springs, the first of a chain's states; all states are zero at rest."""
SLIDE = STRETCH + MOST_NODES + 1
"""Pre-sliding states of the nodes."""
STEP = SLIDE + MOST_NODES
"""Latest displacements in m of the nodes and of the wire's end behind them, towards the motor."""
OFFSET = STEP + MOST_NODES + 1
GAIN = OFFSET + MOST_NODES
"""A node's step is its offset plus its gain times the next node's step."""
WIRE_A = SLOTS.state_block(GAIN + MOST_NODES)
WIRE_B = SLOTS.state_block(GAIN + MOST_NODES)


@compiled
def length(parameters: Array, spring: int) -> float:
    """Share of the wire's length that is before, between or after the nodes."""
    nodes = int(parameters[COUNT])
    if spring == 0 or spring == nodes:
        return parameters[FREE_END]
    return (1.0 - 2.0 * parameters[FREE_END]) / (nodes - 1)
