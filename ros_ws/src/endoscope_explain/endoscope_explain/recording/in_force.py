"""What the motor driver of the live graph told the shafts, tick by tick, from what a bag holds.

A command says what was asked for. What was in force follows from it as in the driver: motion
sessions, the gate, the shaper, and the measured pose that is held once commands have ended.
"""

from dataclasses import replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.joint_state_series import JointStateSeries
from endoscope_bags.recording import Recording as Bag
from endoscope_core.rig import Rig
from endoscope_core.safety import (
    CommandLimits,
    MotionLimits,
    MotionSession,
    OperatingState,
    ShaftMotion,
)

SESSION = 'slave/motion_session'
STATE = 'slave/operating_state'
_NEVER_NS = 10**18
# In the order in which they count within one tick: commands are judged in the next turn, by the
# session of then.
_TURN, _STATE, _SESSION, _COMMAND = range(4)

Goals = NDArray[np.float64]


def goals_in_force(
    bag: Bag, command: JointStateSeries, motor: JointStateSeries, namespace: str | None, rig: Rig
) -> tuple[JointStateSeries, float, str] | None:
    """Goals of the shafts at every tick of the motor driver, each in force from its stamp.

    Parameters
    ----------
    bag : Bag
        For motion sessions and operating states.
    command : JointStateSeries
        Commands to the motors.
    motor : JointStateSeries
        Readings of the motors, one for each tick of the driver.
    namespace : str or None
        Of the rig's topics, where a bag has several rigs.
    rig : Rig

    Returns
    -------
    JointStateSeries
        With positions of the motors that are commanded, under the commands' topic. Its messages
        are those of the readings, so that what was lost of them was lost of it.
    float
        By how much (rms, s) it is unknown when a goal took effect.
    str
        What was done, in words.
    None
        The bag does not tell: it has no motion sessions, or not all motors were read.
    """
    known = bag.has(SESSION, namespace) and bag.has(STATE, namespace)
    if not known or motor.position is None or not set(command.names) <= set(motor.names):
        return None
    if np.any(np.diff(motor.stamp_ns) <= 0) or np.any(np.diff(motor.log_ns) < 0):
        return None
    driver = _Driver(len(command.names), rig)
    asked, read = command.require('position'), motor.select(command.names).require('position')
    sessions = [(m.log_ns, o.frame_id) for m, o in bag.decoded(bag.find(SESSION, namespace))]
    states = [(m.log_ns, o.data) for m, o in bag.decoded(bag.find(STATE, namespace))]
    events = [(queued, _TURN, k) for k, queued in enumerate(_queued(motor).tolist())]
    events += [(log, _STATE, k) for k, (log, _) in enumerate(states)]
    events += [(log, _SESSION, k) for k, (log, _) in enumerate(sessions)]
    events += [(log, _COMMAND, k) for k, log in enumerate(command.log_ns.tolist())]
    events.sort()
    driver.join(states[0][1], sessions[0][1], events[0][0])
    if command.log_ns[0] - motor.log_ns[0] <= rig.timeouts.command_ns and sessions[0][1]:
        driver.take_over(asked[0])
    stamps = motor.stamp_ns.tolist()
    goals = np.empty(read.shape)
    held: list[float] = []
    turned = motor.log_ns.tolist()
    for log_ns, kind, k in events:
        if kind == _TURN:
            period = 1e-9 * (stamps[k] - stamps[k - 1]) if k else 1e-3
            before = driver.motion.holding
            goals[k] = driver.turn(turned[k], period, read[k])
            if driver.motion.holding and not before and k:
                held.append(1e-9 * (stamps[k] - stamps[0]))
        elif kind == _STATE:
            driver.hear_state(states[k][1])
        elif kind == _SESSION:
            driver.hear_session(sessions[k][1], log_ns)
        else:
            driver.hear_command(int(command.stamp_ns[k]), asked[k], log_ns)
    # What a turn sets has acted since the one before.
    series = motor.select(command.names).ordered(np.arange(len(goals) - 1))
    series = replace(series, topic=command.topic, position=goals[1:], velocity=None, effort=None)
    return series, _timing(motor), _in_words(command.topic, held)


def _queued(motor: JointStateSeries) -> NDArray[np.int64]:
    """When each turn of the driver came to wait behind what its process had heard by then, in ns.

    A beat is queued when it is due, one period after the last one that was served: what is heard
    from then on is dealt with after the turn, however late that is served and recorded.
    """
    period = np.min(np.diff(motor.stamp_ns))
    # Of another clock than the recorder's it is only known that the turn came before its reading.
    ahead = max(0, int(np.min(motor.log_ns - motor.stamp_ns)) - period)
    due = np.concatenate([motor.stamp_ns[:1], motor.stamp_ns[:-1] + period]) + ahead
    return np.minimum(due, motor.log_ns)


def _timing(motor: JointStateSeries) -> float:
    """In real time a command that came within a beat may have been taken before or after it."""
    if np.array_equal(motor.log_ns, motor.stamp_ns):
        return 0.0
    return float(np.median(np.diff(motor.stamp_ns))) * 1e-9 / sqrt(12.0)


def _in_words(topic: str, held: list[float]) -> str:
    text = f'what the driver made of {topic} in its motion sessions is simulated'
    if not held:
        return text
    times = 'once' if len(held) == 1 else f'{len(held)} times'
    return f'{text}; it held the measured pose {times}, first at {held[0]:.3f} s'


class _Driver:
    """The motor driver's part in what the shafts do."""

    def __init__(self, joints: int, rig: Rig) -> None:
        motors = rig.motors
        limits = (motors.reach, motors.speed, motors.acceleration, motors.step)
        self.motion = ShaftMotion(
            CommandLimits(
                motors.reach, 1.25 * motors.speed, motors.entry_step, rig.timeouts.command_ns
            ),
            MotionLimits.either_way(joints, *limits),
        )
        # A driver that left a session by itself brings about a fault, which ends the session; what
        # is missing from the recording must not be taken for that.
        self.motion.session = MotionSession(_NEVER_NS, _NEVER_NS)
        self._state = ''
        self._torque = True
        self._goal: tuple[float, ...] = ()
        self._arrived: list[tuple[int, Goals, int]] = []
        self._going_on: Goals | None = None

    def join(self, state: str, session: str, now_ns: int) -> None:
        """Begin in the state and session that the recording begins with."""
        self.motion.session.hear('', now_ns)
        self.motion.session.hear(session, now_ns)
        self.hear_state(state)

    def take_over(self, asked: Goals) -> None:
        """Begin in the middle of a stream of commands."""
        self._going_on = asked

    def hear_state(self, state: str) -> None:
        self._state = state
        self._let_go()

    def hear_session(self, name: str, now_ns: int) -> None:
        if self.motion.session.hear(name, now_ns):
            self._torque = True
        self._let_go()

    def _let_go(self) -> None:
        if self._state == OperatingState.DISABLED and not self.motion.session.name:
            self._torque = False

    def hear_command(self, stamp_ns: int, asked: Goals, now_ns: int) -> None:
        self._arrived.append((stamp_ns, asked, now_ns))

    def turn(self, now_ns: int, period: float, read: Goals) -> tuple[float, ...]:
        motion = self.motion
        for stamp_ns, asked, received_ns in self._arrived:
            motion.command(motion.session.name, stamp_ns, asked.tolist(), (), received_ns)
            self._going_on = None
        self._arrived.clear()
        goal = motion.turn(now_ns, period)
        motion.measure((read if self._going_on is None else self._going_on).tolist())
        if not self._goal or self._torque:
            self._goal = goal or self.motion.goal
        return self._goal
