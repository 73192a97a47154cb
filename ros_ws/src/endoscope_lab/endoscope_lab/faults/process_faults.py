"""What can befall the processes and topics of the graph, and what follows."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header, String

from endoscope_bags import open_bag
from endoscope_bags.errors import BagError
from endoscope_lab.faults.node_processes import GRAPH, NODES
from endoscope_lab.faults.process_rig import ProcessRig
from endoscope_lab.faults.trace import ShaftTrace, goal_step
from endoscope_nodes.names import (
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
)
from endoscope_nodes.runtime.diagnostics import OK, status
from endoscope_nodes.runtime.qos import COMMAND, EVENT, RESULT, SENSOR_OFFERED

STALLS_S = (0.2, 0.5, 2.0)
_AFTERMATH_S = 1.0
_MOST_TRIES = 10
_RIVAL_TURNS = 75
_TURN_S = 0.004


@dataclass(frozen=True)
class ProcessFault:
    """Something that goes wrong in motion.

    `inject`: makes it happen.
    `source`: whose motion it is: ``master`` for the handle, ``motion`` for one that the master
        plays, ``outside`` for a program that writes `slave/servo_jp` itself.
    `kills`: process that is gone afterwards.
    `pauses`: whether the operator himself lets the slave stand and move again.
    """

    inject: Callable[[ProcessRig], object]
    source: str = 'master'
    kills: str = ''
    pauses: bool = False


@dataclass(frozen=True)
class Outcome:
    """What followed a fault; angles in rad, times in s.

    `state`, `cause`: operating state before the next enable, and why.
    `goal_step`, `goal_share`: largest step of `motor/servo_jp`, and the largest in parts of what
        the shaper allows.
    `shaft_step`, `shaft_speed`: largest step of a shaft from reading to reading, and its largest
        speed over 10 ms.
    `still_s`: from the fault to standstill; None where the motion went on, or the plant died.
    `unasked`: how far shafts went at rest, with no session open, before the next enable.
    `gap_s`: longest time between two readings of the shafts, by their stamps.
    `enabled_s`: from the next enable to motion; None where that did not come.
    `before`: what ended the motion before the fault, each time that it was tried again.
    `bag`: seconds between the last message of a killed recorder's bag and the fault; messages lost
        by one that lives, below zero.
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


def undergo(fault: ProcessFault, rig: ProcessRig) -> Outcome:
    """Make a fault happen at a random instant of the motion, and look at what follows."""
    operator = rig.operator
    if fault.kills == 'recorder' and 'recorder' in rig.processes.running:
        # A bag of its own, for what is complete is found by reading it.
        rig.end('recorder')
    before: list[str] = []
    while not _moves(rig, fault.source):
        before.append(operator.graph.why)
        if len(before) > _MOST_TRIES:
            raise RuntimeError(f'the motion ends before anything breaks: {before[-1]}')
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
    return Outcome(
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
    """Bring it to move; whether it still does at a random instant."""
    operator = rig.operator
    rig.begin(source)
    if rig.enable_and_move() is None:
        return False
    operator.shafts.clear()
    operator.goals.clear()
    operator.serve(rig.random.uniform(0.3, 1.5))
    moves = operator.graph.state == 'ENABLED'
    if not moves:
        # The cause is told within a second.
        operator.serve(1.1)
    return moves


def _lost(rig: ProcessRig) -> int:
    said = rig.operator.graph.health.get('recorder: recording')
    return int(said.values.get('lost', 0)) if said else 0


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


def _speak(kind: type, topic: str, make: Callable[[ProcessRig], Any], qos: Any) -> ProcessFault:
    def inject(rig: ProcessRig) -> None:
        message = make(rig)
        publisher = rig.operator.node.create_publisher(kind, topic, qos)
        for _ in range(_RIVAL_TURNS):
            if hasattr(message, 'header'):
                stamp = message.header.stamp
                stamp.sec, stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
            publisher.publish(message)
            rig.operator.serve(_TURN_S)
        publisher.destroy()
        if topic == MOTOR_COMMAND:
            # Those were the rival's.
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


def _result(rig: ProcessRig) -> DiagnosticArray:
    message = DiagnosticArray()
    message.header.frame_id = rig.operator.graph.session
    message.status = [status('calibration: hysteresis class', OK, '', {'class_deg': 100})]
    return message


def _clutch(rig: ProcessRig) -> Joy:
    return Joy(buttons=[rig.random.randrange(2)])


def _speak_while_disabled(rig: ProcessRig) -> None:
    rig.operator.graph.order('disable')
    rig.operator.serve(0.3)
    state = _speak(String, OPERATING_STATE, lambda _: String(data='ENABLED'), RESULT)
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


def _rivals() -> dict[str, ProcessFault]:
    commands = {
        topic: _speak(JointState, topic, partial(_command, names), qos)
        for topic, names, qos in (
            (SLAVE_COMMAND, JOINTS, COMMAND),
            (CORRECTION, JOINTS, COMMAND),
            (CALIBRATION_COMMAND, JOINTS, COMMAND),
            (MOTOR_COMMAND, MOTORS, COMMAND),
            (MASTER_MEASURED, JOINTS, SENSOR_OFFERED),
        )
    }
    others = {
        OPERATING_STATE: _speak(String, OPERATING_STATE, lambda _: String(data='ENABLED'), RESULT),
        MOTION_SESSION: _speak(Header, MOTION_SESSION, lambda _: Header(frame_id='x-1'), EVENT),
        CALIBRATION_RESULT: _speak(DiagnosticArray, CALIBRATION_RESULT, _result, RESULT),
        MASTER_CLUTCH: _speak(Joy, MASTER_CLUTCH, _clutch, EVENT),
    }
    return {f'rival on {topic}': fault for topic, fault in (commands | others).items()}


def _of_process(name: str) -> dict[str, ProcessFault]:
    kill = ProcessFault(lambda rig: rig.kill(name), kills=name)
    stalls = {
        f'{name} stalled for {s:g} s': ProcessFault(partial(_stall, name, s)) for s in STALLS_S
    }
    return {f'{name} killed': kill} | stalls


_ANYWHERE: dict[str, ProcessFault] = {
    'nothing': ProcessFault(lambda rig: rig.operator.serve(3.0)),
    **_rivals(),
    'a rival sends ENABLED while DISABLED': ProcessFault(_speak_while_disabled),
    'clutch released and pressed within 0.6 s': ProcessFault(_clutch_again, pauses=True),
    'handle and clutch silent for up to 0.6 s': ProcessFault(_fall_silent, pauses=True),
    'old commands sent again, outside program': ProcessFault(_replay, 'outside'),
    'commands 0.12 to 0.5 s late, outside program': ProcessFault(_come_late, 'outside'),
}
COMPOSED_FAULTS: Mapping[str, ProcessFault] = _ANYWHERE | _of_process(GRAPH)
"""Where all nodes share a process."""

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
"""Where each node is a process."""
