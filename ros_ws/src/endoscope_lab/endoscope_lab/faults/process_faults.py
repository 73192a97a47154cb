"""Faults of the processes and topics of the graph, and the responses to them."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header, String

from endoscope_bags import open_bag
from endoscope_bags.errors import BagError
from endoscope_lab.faults.node_processes import GRAPH, NODES
from endoscope_lab.faults.process_rig import ProcessRig
from endoscope_lab.faults.trace import ShaftTrace, goal_step
from endoscope_nodes.names import (
    BOUNDS,
    CALIBRATION_COMMAND,
    CALIBRATION_RESULT,
    CORRECTION,
    JOINTS,
    MASTER_CLUTCH,
    MASTER_MEASURED,
    MOTION_SESSION,
    MOTOR_COMMAND,
    MOTORS,
    OPERATING_STATE,
    SLAVE_COMMAND,
    SLAVE_VELOCITY,
    TIP_FORCE_BOUNDS,
    TIP_VELOCITY,
)
from endoscope_nodes.runtime.diagnostics import OK, status
from endoscope_nodes.runtime.qos import COMMAND, EVENT, RESULT, SENSOR_OFFERED

STALLS_S = (0.2, 0.5, 2.0)
_AFTERMATH_S = 1.0
_MOST_TRIES = 10
_COMPETING_TURNS = 75
_TURN_S = 0.004


@dataclass(frozen=True)
class ProcessFault:
    """A fault that is injected in motion.

    `inject`: injects it.
    `source`: source of the motion: ``master`` for the handle, ``motion`` for one that the master
        plays, ``outside`` for a program that writes `slave/servo_jp` itself.
    `kills`: process that the fault ends.
    `pauses`: whether the operator stops the slave and moves it again.
    """

    inject: Callable[[ProcessRig], object]
    source: str = 'master'
    kills: str = ''
    pauses: bool = False


@dataclass(frozen=True)
class FaultResponse:
    """Response to a fault; angles in rad, times in s.

    `state`, `cause`: operating state before the next enable, and its cause.
    `goal_step`, `goal_share`: largest step of `motor/servo_jp`, and the largest as a share of the
        bound of the shaper.
    `shaft_step`, `shaft_speed`: largest step of a shaft between readings, and its largest speed
        over 10 ms.
    `still_s`: from the fault to standstill; None if the motion continued, or the plant died.
    `unasked`: travel of the shafts without an open session, before the next enable.
    `gap_s`: longest time between two readings of the shafts, by their stamps.
    `enabled_s`: from the next enable to motion; None if there was none.
    `before`: causes that ended the motion before the fault, one for each repeated attempt.
    `bag`: seconds from the last message in a killed recorder's bag to the fault; for a recorder
        that survives, the number of lost messages, negative.
    """

    state: str
    cause: str
    goal_step: float
    goal_share: float
    shaft_step: float
    shaft_speed: float
    still_s: float | None
    unasked: float
    gap_s: float
    enabled_s: float | None
    before: tuple[str, ...]
    bag: float


def undergo(fault: ProcessFault, rig: ProcessRig) -> FaultResponse:
    """Inject a fault at a random instant of the motion, and observe the response."""
    operator = rig.operator
    if fault.kills == 'recorder' and 'recorder' in rig.processes.running:
        # In a bag of its own, since completeness is found by reading the bag.
        rig.end('recorder')
    before: list[str] = []
    while not _moves(rig, fault.source):
        before.append(operator.graph.why)
        if len(before) > _MOST_TRIES:
            raise RuntimeError(f'the motion ends before the fault: {before[-1]}')
    lost, bag = _lost(rig), rig.bag
    fault_ns = since_ns = time.time_ns()
    fault.inject(rig)
    operator.serve(rig.random.uniform(0.0, _AFTERMATH_S))
    plant_died = fault.kills in ('motor_driver', GRAPH)
    if plant_died:
        operator.shafts.clear()
        since_ns = time.time_ns()
    rig.revive()
    operator.serve(_AFTERMATH_S)
    state, cause, open_ns = operator.graph.state, operator.graph.why, operator.graph.open_ns
    enable_ns = time.time_ns()
    enabled_s = rig.enable_and_move()
    operator.serve(0.3)
    if enabled_s is None:
        rig.kill_all()
    shafts = ShaftTrace(operator.shafts)
    still_s, unasked = shafts.standstill(since_ns, open_ns, enable_ns)
    step, share = goal_step(operator.goals, rig.facts.motors)
    return FaultResponse(
        state,
        cause,
        step,
        share,
        shafts.step(round(1.5e9 / rig.rate)),
        shafts.speed(),
        None if plant_died else still_s,
        0.0 if fault.pauses else unasked,
        shafts.longest_gap(),
        enabled_s,
        tuple(before),
        _complete_to(bag, fault_ns) if fault.kills in ('recorder', GRAPH) else lost - _lost(rig),
    )


def _moves(rig: ProcessRig, source: str) -> bool:
    """Start a motion; whether it still continues at a random instant."""
    operator = rig.operator
    rig.begin(source)
    if rig.enable_and_move() is None:
        return False
    operator.shafts.clear()
    operator.goals.clear()
    operator.serve(rig.random.uniform(0.3, 1.5))
    moves = operator.graph.state == 'ENABLED'
    if not moves:
        # The cause is published within a second.
        operator.serve(1.1)
    return moves


def _lost(rig: ProcessRig) -> int:
    status_of_recorder = rig.operator.graph.health.get('recorder: recording')
    return int(status_of_recorder.values.get('lost', 0)) if status_of_recorder else 0


def _complete_to(bag: Path, fault_ns: int) -> float:
    try:
        return (fault_ns - open_bag(bag, salvage=True).end_ns) * 1e-9
    except BagError:
        return math.inf


def _stall(name: str, seconds: float, rig: ProcessRig) -> None:
    rig.processes.stall(name)
    rig.operator.serve(seconds)
    rig.processes.resume(name)


def _stall_with_clutch(rig: ProcessRig) -> None:
    rig.processes.stall('master')
    for held in (False, True):
        rig.operator.serve(0.25)
        rig.operator.press(held)
    rig.processes.resume('master')


def _press_while_the_driver_stalls(rig: ProcessRig) -> None:
    rig.operator.press(False)
    rig.operator.serve(0.1)
    rig.processes.stall('motor_driver')
    rig.operator.serve(0.2)
    rig.operator.press(True)
    rig.operator.serve(0.1)
    rig.processes.resume('motor_driver')


def _publish(kind: type, topic: str, make: Callable[[ProcessRig], Any], qos: Any) -> ProcessFault:
    def inject(rig: ProcessRig) -> None:
        message = make(rig)
        publisher = rig.operator.node.create_publisher(kind, topic, qos)
        for _ in range(_COMPETING_TURNS):
            if hasattr(message, 'header'):
                stamp = message.header.stamp
                stamp.sec, stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
            publisher.publish(message)
            rig.operator.serve(_TURN_S)
        publisher.destroy()
        if topic == MOTOR_COMMAND:
            # These were from the competing publisher.
            rig.operator.goals.clear()
        if topic == MASTER_CLUTCH:
            rig.operator.let_go_and_press()

    return ProcessFault(inject)


def _command(names: tuple[str, ...], rig: ProcessRig) -> JointState:
    at = rig.operator.shafts[-1].position
    near = [x + rig.random.uniform(-0.1, 0.1) for x in at]
    position = rig.random.choice((near, [1.0, -1.0], [1e9, 0.0], [math.nan, 0.0]))
    message = JointState(name=list(names), position=position)
    message.header.frame_id = rig.operator.graph.session
    return message


def _velocity(rig: ProcessRig) -> JointState:
    velocity = rig.random.choice(([1.0, -1.0], [1e9, 0.0], [math.nan, 0.0]))
    message = JointState(name=list(JOINTS), velocity=velocity)
    message.header.frame_id = rig.operator.graph.session
    return message


def _twist(rig: ProcessRig) -> TwistStamped:
    message = TwistStamped()
    message.header.frame_id = rig.operator.graph.session
    message.twist.angular.x = rig.random.choice((1.0, 1e9, math.nan))
    return message


def _force(rig: ProcessRig) -> JointState:
    force = rig.random.choice((0.0, 0.5, -0.5, 1e9, math.nan))
    return JointState(name=list(BOUNDS), effort=[force] * 6 + [1.0])


def _result(rig: ProcessRig) -> DiagnosticArray:
    message = DiagnosticArray()
    message.header.frame_id = rig.operator.graph.session
    message.status = [status('calibration: hysteresis class', OK, '', {'class_deg': 100})]
    return message


def _clutch(rig: ProcessRig) -> Joy:
    return Joy(buttons=[rig.random.randrange(2)])


def _publish_while_disabled(rig: ProcessRig) -> None:
    rig.operator.graph.order('disable')
    rig.operator.serve(0.3)
    state = _publish(String, OPERATING_STATE, lambda _: String(data='ENABLED'), RESULT)
    state.inject(rig)


def _clutch_again(rig: ProcessRig) -> None:
    rig.operator.press(False)
    rig.operator.serve(rig.random.uniform(0.0, 0.6))
    rig.operator.press(True)


def _fall_silent(rig: ProcessRig) -> None:
    time.sleep(rig.random.uniform(0.0, 0.6))


def _replay(rig: ProcessRig) -> None:
    rig.operator.replays = True
    rig.operator.serve(0.5)
    rig.operator.replays = False


def _come_late(rig: ProcessRig) -> None:
    rig.operator.late_ns = round(rig.random.uniform(0.12, 0.5) * 1e9)
    rig.operator.serve(0.5)
    rig.operator.late_ns = 0


def _competing_publishers() -> dict[str, ProcessFault]:
    commands = {
        topic: _publish(JointState, topic, partial(_command, names), qos)
        for topic, names, qos in (
            (SLAVE_COMMAND, JOINTS, COMMAND),
            (CORRECTION, JOINTS, COMMAND),
            (CALIBRATION_COMMAND, JOINTS, COMMAND),
            (MOTOR_COMMAND, MOTORS, COMMAND),
            (MASTER_MEASURED, JOINTS, SENSOR_OFFERED),
        )
    }
    others = {
        OPERATING_STATE: _publish(
            String, OPERATING_STATE, lambda _: String(data='ENABLED'), RESULT
        ),
        MOTION_SESSION: _publish(Header, MOTION_SESSION, lambda _: Header(frame_id='x-1'), EVENT),
        CALIBRATION_RESULT: _publish(DiagnosticArray, CALIBRATION_RESULT, _result, RESULT),
        MASTER_CLUTCH: _publish(Joy, MASTER_CLUTCH, _clutch, EVENT),
        SLAVE_VELOCITY: _publish(JointState, SLAVE_VELOCITY, _velocity, COMMAND),
        TIP_VELOCITY: _publish(TwistStamped, TIP_VELOCITY, _twist, COMMAND),
        TIP_FORCE_BOUNDS: _publish(JointState, TIP_FORCE_BOUNDS, _force, SENSOR_OFFERED),
    }
    faults = commands | others
    return {f'competing publisher on {topic}': fault for topic, fault in faults.items()}


def _of_process(name: str) -> dict[str, ProcessFault]:
    kill = ProcessFault(lambda rig: rig.kill(name), kills=name)
    stalls = {
        f'{name} stalled for {s:g} s': ProcessFault(partial(_stall, name, s)) for s in STALLS_S
    }
    return {f'{name} killed': kill} | stalls


_ANYWHERE: dict[str, ProcessFault] = {
    'nothing': ProcessFault(lambda rig: rig.operator.serve(3.0)),
    **_competing_publishers(),
    'competing publisher sends ENABLED while DISABLED': ProcessFault(_publish_while_disabled),
    'clutch released and pressed within 0.6 s': ProcessFault(_clutch_again, pauses=True),
    'handle and clutch silent for up to 0.6 s': ProcessFault(_fall_silent, pauses=True),
    'old commands sent again, outside program': ProcessFault(_replay, 'outside'),
    'commands 0.12 to 0.5 s late, outside program': ProcessFault(_come_late, 'outside'),
}
COMPOSED_FAULTS: Mapping[str, ProcessFault] = _ANYWHERE | _of_process(GRAPH)
"""Faults of a graph in one process."""

PROCESS_FAULTS: Mapping[str, ProcessFault] = (
    _ANYWHERE
    | {name: fault for node in NODES for name, fault in _of_process(node).items()}
    | {
        'master stalled for 0.5 s, clutch released and pressed': ProcessFault(_stall_with_clutch),
        'motor_driver stalled for 0.3 s, clutch pressed': ProcessFault(
            _press_while_the_driver_stalls
        ),
        'supervisor killed, master plays': ProcessFault(
            lambda rig: rig.kill('supervisor'), 'motion', 'supervisor'
        ),
        'master killed, master plays': ProcessFault(
            lambda rig: rig.kill('master'), 'motion', 'master'
        ),
        'master stalled for 2 s, master plays': ProcessFault(
            partial(_stall, 'master', 2.0), 'motion'
        ),
    }
)
"""Faults of a graph with one process for each node."""
