"""A participant of another DDS implementation, in a process of its own.

It is made of what the page for other people's programs shows, in the folder named first. It speaks
for the handle at 100 Hz, tells on stdout what it hears, as JSON, and obeys the lines on stdin:
`hold`, `release`, `move RAD` (at half a radian per second), `order WORD`.
"""

import json
import sys
import threading
import time
from dataclasses import dataclass, field

sys.path.insert(0, sys.argv[1])
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, sequence
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from handle import LATCHED, STREAM, Header, JointState, Joy, Participant, String, publish

_STREAMS = ('motor/measured_js', 'wires/measured_js', 'slave/measured_js')
_STATE = 'slave/operating_state'
_TRANSFORMS = '/tf'
_STEP_S, _STEP_RAD = 0.01, 0.005
_MANY = 10_000


@dataclass
class Vector3(IdlStruct, typename='geometry_msgs.msg.dds_.Vector3_'):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename='geometry_msgs.msg.dds_.Quaternion_'):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Transform(IdlStruct, typename='geometry_msgs.msg.dds_.Transform_'):
    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@dataclass
class TransformStamped(IdlStruct, typename='geometry_msgs.msg.dds_.TransformStamped_'):
    header: Header = field(default_factory=Header)
    child_frame_id: str = ''
    transform: Transform = field(default_factory=Transform)


@dataclass
class TFMessage(IdlStruct, typename='tf2_msgs.msg.dds_.TFMessage_'):
    transforms: sequence[TransformStamped] = ()


participant = Participant()
of_all = participant._participant
transforms = DataReader(of_all, Topic(of_all, 'rt/tf', TFMessage), qos=STREAM)
streams = {topic: participant.reader(topic, JointState) for topic in _STREAMS}
state = participant.reader(_STATE, String, LATCHED)
handle = participant.writer('master/measured_js', JointState)
clutch = participant.writer('master/clutch', Joy)
orders = participant.writer('slave/state_command', String)
wanted = {'held': False, 'angle': 0.0}


def obey() -> None:
    for line in sys.stdin:
        word, *values = line.split()
        if word == 'move':
            wanted['angle'] = float(values[0])
        elif word == 'order':
            orders.write(String(values[0]))
        else:
            wanted['held'] = word == 'hold'
    wanted.clear()


def tell(topic: str, values: object) -> None:
    print(json.dumps([topic, values]), flush=True)


def sample(message: JointState) -> list:
    stamp = message.header.stamp
    fields = (message.position, message.velocity, message.effort)
    return [stamp.sec * 10**9 + stamp.nanosec, list(message.name), *map(list, fields)]


def poses(message: TFMessage) -> list:
    told = []
    for t in message.transforms:
        stamp, moved, turned = t.header.stamp, t.transform.translation, t.transform.rotation
        pose = [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z, turned.w]
        told.append([stamp.sec * 10**9 + stamp.nanosec, t.header.frame_id, t.child_frame_id, pose])
    return told


threading.Thread(target=obey, daemon=True).start()
angle = 0.0
while now := dict(wanted):
    for message in state.take(_MANY):
        tell(_STATE, message.data)
    if links := [poses(message) for message in transforms.take(_MANY)]:
        tell(_TRANSFORMS, links)
    for topic, reader in streams.items():
        if heard := [sample(message) for message in reader.take(_MANY)]:
            tell(topic, heard)
    angle += min(max(now['angle'] - angle, -_STEP_RAD), _STEP_RAD)
    publish(now['held'], angle, handle, clutch)
    time.sleep(_STEP_S)
