"""`endoscope bench touch --push`: a hand that pushes on, with the guard of the tip and without."""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.choices import BY_ADOPTED, PHYSICAL
from endoscope_core.compensation.command_stream import Command, CommandStream, Measured
from endoscope_core.compensation.law_in_force import LawInForce, Selection
from endoscope_core.control import AdoptedPlant, Feedforward, FeedforwardSettings, MotorLimits
from endoscope_core.control.internal_model import PhysicalParameters
from endoscope_core.identification.law_choice import LawChoice
from endoscope_core.names import JOINTS
from endoscope_core.physics import PlantDescription
from endoscope_core.physics.simulator import TICK
from endoscope_core.rig import shipped_rig
from endoscope_core.safety import BendingRange, FeltForce, GuardState
from endoscope_core.signals import hold, sequence
from endoscope_core.signals.motions import move
from endoscope_core.tip_force import TipForce
from endoscope_core.tip_force.free_motion import BLOCK_S
from endoscope_lab.bench import table_head, table_row
from endoscope_lab.concealed import motions
from endoscope_lab.touch.touched_rig import (
    Obstacle,
    Prepared,
    drawn,
    portion,
    prepared,
)

Array = NDArray[np.float64]

AIM = 0.4
"""Largest force with the guard over that without it."""
WALL = (200.0, 2000.0)
"""Stiffness of a wall, N/m."""
_SLOWEST = 0.3
"""Smallest speed of a hand, largest of the motion, rad/s; it is no faster than it is followed."""
_PEAK = 1.875
"""Largest speed of a minimum-jerk motion over its mean."""
_HELD_S = 1.5
_SWEEP_S = 0.8
_BEFORE = 0.8
"""Share of the way to the obstacle that all joints go first, which makes their memory known."""
_NS_PER_TICK = round(1e9 * TICK)
_TICKS = round(BLOCK_S / TICK)
"""Commands between two estimates."""
_FAST = 1.0
"""Largest speed of a hand in rad/s, above which it reaches and below which it pushes."""


@dataclass(frozen=True)
class Push:
    """One push; true forces in N."""

    simulator: str
    seed: int
    stiffness: float  # of the obstacle across the tip, N/m
    speed: float  # largest of the hand, rad/s
    without: float  # largest force without the guard
    guarded: float  # and with it
    at_end: float  # with it, when the hand has held for 1.5 s
    # From the limit until the guard yields, s; infinite where it does not, negative where it yields
    # below the limit, minus infinity if that is never reached, and NaN where neither happens.
    late: float
    early: bool  # whether it yields before it touches
    when_yielding: float  # force then; the largest where it does not yield

    @property
    def case(self) -> tuple[str, int]:
        """As it was asked for."""
        return self.simulator, self.seed

    @property
    def ratio(self) -> float:
        """Largest force with the guard over that without it."""
        return self.guarded / self.without if self.without else 1.0


class _Hand:
    """All joints sweep before a wall, then one is pushed into it to its reach, and held there."""

    def __init__(self, generator: np.random.Generator, joints: int) -> None:
        rig = shipped_rig().joints
        largest = np.full(joints, generator.uniform(*motions.REACH))
        self.met: Obstacle = drawn(generator, largest, WALL)
        self.speed = math.exp(generator.uniform(*np.log((_SLOWEST, rig.hand_speed))))
        near, deep = _BEFORE * self.met.angle, math.copysign(rig.reach, self.met.angle)
        seconds = _PEAK * rig.reach / self.speed
        turns = pairwise((0.0, -near, near, -near, 0.0))
        sweeps = sequence('sweeps', [*(move(a, b, _SWEEP_S) for a, b in turns), hold(_SWEEP_S)])
        push = sequence('push', [sweeps, move(0.0, deep, seconds), hold(_HELD_S, deep)])
        self.begin = sweeps.duration  # of the push, s
        blocks = round(push.duration / TICK) // _TICKS
        time = TICK * np.arange(blocks * _TICKS)
        columns = [sweeps(np.minimum(time, sweeps.duration))] * len(JOINTS)
        columns[self.met.joint] = push(time)
        self.angle, self.velocity = (
            np.column_stack(part) for part in zip(*columns, strict=True)
        )  # desired (N, J), rad and rad/s


class _Compensator:
    """The compensator's stream of commands, by the inverse of a plant."""

    def __init__(self, plant: PlantDescription, hand: _Hand, later: float) -> None:
        rig, joints = shipped_rig(), list(plant.joints.values())
        # A rig of the other simulator has one joint: nothing becomes of what the other is sent.
        parameters = tuple(PhysicalParameters(joint) for joint in (joints * 2)[: len(JOINTS)])
        reach = (BendingRange(-rig.joints.reach, rig.joints.reach),) * len(JOINTS)
        law = LawInForce(
            Feedforward(len(JOINTS), FeedforwardSettings(MotorLimits.of(rig))),
            LawChoice(len(JOINTS)),
            Selection('none', BY_ADOPTED),
        )
        law.adopt(AdoptedPlant('', parameters, reach, (), (0.0, 0.0)), for_session=False)
        law.select(Selection(PHYSICAL, BY_ADOPTED))
        self._stream, self._hand, self._joints = CommandStream(rig, law), hand, len(joints)
        self._origin_ns = round(later * 1e9)
        at_rest = (0.0,) * len(JOINTS)
        self._measured = Measured(at_rest, at_rest)

    @property
    def yields(self) -> bool:
        """Whether the joint that is pushed does."""
        contact = self._stream.contact
        return (
            contact.state is GuardState.YIELDING and JOINTS[self._hand.met.joint] in contact.joints
        )

    def feel(self, force: TipForce) -> None:
        force_n, low, high = (tuple(x.tolist()) for x in (force.force, force.low, force.high))
        felt = FeltForce(round(force.time * 1e9), force_n, low, high)
        self._stream.contact.feel(felt)

    def block(self, begin: int) -> Array:
        """Shaft angles (_TICKS, J) in rad for commands of the hand from one on."""
        sent = []
        for k in range(begin, begin + _TICKS):
            now_ns = self._origin_ns + (k + 1) * _NS_PER_TICK
            asked = (tuple(part[k].tolist()) for part in (self._hand.angle, self._hand.velocity))
            sent.append(self._stream.follow(Command(now_ns, *asked), now_ns, self._measured, True))
        return np.array(sent)[:, : self._joints]


def judged(simulator: str, seed: int) -> Push:
    """Have one rig pushed without the guard and with it, on one core."""
    with threadpool_limits(1):
        ready = prepared(simulator, seed)
        hand = _Hand(ready.generator, len(ready.rig.true.joints))
        compensator = _Compensator(ready.plant, hand, ready.later)
        begins = range(0, len(hand.angle), _TICKS)
        free = np.concatenate([compensator.block(begin) for begin in begins])
        guarded, yielded = _guarded(ready, hand, free, seed + 2)
        time, without = _force(ready, hand, free, seed + 2)
        _, force = _force(ready, hand, guarded, seed + 2)
    limit = shipped_rig().tip.force_limit
    touched, above = (next(iter(time[force > least]), math.inf) for least in (0.0, limit))
    return Push(
        simulator,
        seed,
        hand.met.across,
        hand.speed,
        float(without.max()),
        float(force.max()),
        float(force[-1]),
        float(yielded - above),
        bool(yielded < touched),
        float(np.interp(yielded, time, force)) if yielded < math.inf else float(force.max()),
    )


def _guarded(ready: Prepared, hand: _Hand, free: Array, seed: int) -> tuple[Array, float]:
    """What is sent with the guard (N, J) in rad, and when it yields to the push, in s."""
    compensator = _Compensator(ready.plant, hand, ready.later)
    sent, yielded = np.empty_like(free), math.inf
    found, felt = list[TipForce](), list[TipForce]()
    foreseen = free
    recording, _ = ready.rig.record(foreseen, seed, hand.met)
    begins = range(0, len(free), _TICKS)
    for begin in begins:
        # As in the graph: what came is worked out beside the next block, and known after it.
        for force in felt:
            compensator.feel(force)
        felt = found
        end = begin + _TICKS
        sent[begin:end] = compensator.block(begin)
        if begin * TICK >= hand.begin and yielded == math.inf and compensator.yields:
            yielded = begin * TICK
        # What the rig answers is known as long as what is felt changes nothing of what is sent.
        if not np.array_equal(sent[:end], foreseen[:end]):
            ahead = copy.deepcopy(compensator)
            rest = [ahead.block(k) for k in begins if k >= end]
            foreseen = np.concatenate([sent[:end], *rest])
            recording, _ = ready.rig.record(foreseen, seed, hand.met)
        between = (begin * TICK, end * TICK)
        found = portion(ready.estimator, recording, ready.later, between)
    return sent, yielded


def _force(ready: Prepared, hand: _Hand, sent: Array, seed: int) -> tuple[Array, Array]:
    """Time in s and true force (M,) in N from the beginning of the push on."""
    recording, bending = ready.rig.record(sent, seed, hand.met)
    time = recording.bending.time
    force = np.abs(ready.rig.forces(hand.met, bending)[:, hand.met.joint])
    return time[time >= hand.begin], force[time >= hand.begin]


def print_pushes(rows: Sequence[Push]) -> None:
    """Print the largest forces, and what became of those that the guard can do something about."""
    limit = shipped_rig().tip.force_limit / AIM
    columns = ('pushes', 'without', 'guarded', 'ratio', f'below {AIM}', 'late')
    print(table_head('hand', *columns, 'by then', 'too early', 'never'))
    for fast in (False, True):
        hand = f'{"above" if fast else "below"} {_FAST:g} rad/s'
        of_hand = [r for r in rows if (r.speed > _FAST) == fast and r.without > 0.0]
        strong = [r for r in of_hand if r.without > limit]
        for title, mine in ((hand, of_hand), (f'{hand}, above {limit:.2f} N without', strong)):
            acted = [r for r in mine if not r.early and math.isfinite(r.late)]
            below = sum(r.ratio < AIM for r in mine)
            print(
                table_row(
                    title,
                    len(mine),
                    _median_and_most([r.without for r in mine], ' N'),
                    _median_and_most([r.guarded for r in mine], ' N'),
                    _median_and_most([r.ratio for r in mine]),
                    f'{below / max(1, len(mine)):.0%}',
                    _median_and_most([r.late for r in acted], ' s'),
                    _median_and_most([r.when_yielding for r in acted], ' N'),
                    sum(r.early for r in mine),
                    sum(r.late == math.inf for r in mine),
                )
            )
    print('Median, and largest.')


def _median_and_most(values: Sequence[float], unit: str = '') -> str:
    return f'{np.median(values):.2f}, {max(values):.2f}{unit}' if values else '-'
