"""What an operator could change of a rig where no motion decides what an answer leaves open."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.design import LEAST_NATS, Asking, Changed
from endoscope_explain.prediction_set import SOMETHING_ELSE

WEIGHT_NM = 9.81 * 0.005 * 0.03
"""Moment of 5 g at 30 mm: a third of what bends a section like the described one by a radian."""
BEND = 1.5
"""Share of its bend that a tube in another shape has."""


@dataclass(frozen=True)
class OperatorChange:
    """A change of a rig by an amount that is known."""

    words: str
    minutes: int  # of an operator's work, as a guess
    changed: Changed
    unknown: str = ''  # nominal number that it leaves unknown


def weighted(plant: PlantDescription, joint: str) -> PlantDescription:
    """The plant with a weight at the tip of a joint's section, which lies horizontally."""
    # A constant moment over the stiffness is a shift of the rest angle; the moment of a weight
    # that hangs is constant to first order of the bend.
    numbers = plant.joints[joint]
    rest = numbers.joint_rest_angle + WEIGHT_NM / numbers.joint_stiffness
    return replace(plant, joints={**plant.joints, joint: replace(numbers, joint_rest_angle=rest)})


def bent_more(plant: PlantDescription, joint: str) -> PlantDescription:
    """The plant of a joint whose wires run through a tube of more bend."""
    numbers = plant.joints[joint]
    more = replace(numbers, capstan_exponent=BEND * numbers.capstan_exponent)
    return replace(plant, joints={**plant.joints, joint: more})


CHANGES = (
    OperatorChange('a weight of 5 g at the horizontal tip, 30 mm from the joint', 2, weighted),
    OperatorChange('a tube bent half as much again', 3, bent_more, 'capstan_exponent'),
)


def what_would_decide(asked: Sequence[Asking], jobs: int = 1) -> str:
    """What would decide the first question between laws, in a sentence; empty if there is none."""
    for asking in asked:
        if len(asking.laws) < 2:
            continue
        names = ' and '.join(name for name in asking.question.chances if name != SOMETHING_ELSE)
        unchanged = asking.best(jobs, ())
        least = LEAST_NATS + (0.0 if unchanged is None else unchanged.nats)
        for change in CHANGES:
            best = asking.once(change.changed, change.unknown).best(jobs, ())
            # What a motion is expected to bring without the change is not due to it.
            if best is not None and best.nats >= least:
                return (
                    f'{change.words.capitalize()} would distinguish {names} '
                    f'({best.segment.name}, {best.nats:.0f} nats; about {change.minutes} min of '
                    'work).'
                )
        return f'Neither {" nor ".join(c.words for c in CHANGES)} would distinguish {names}.'
    return ''
