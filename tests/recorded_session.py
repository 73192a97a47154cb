"""A recorder in the process of a test, real topics that it hears, and what was sent on them."""

import time
from collections.abc import Mapping
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from probed_graph import ProbedRuntime
from rclpy.context import Context
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header, String

from endoscope_bags.cdr import encode_joint_state, encode_poses
from endoscope_bags.message_types import TF_MESSAGE
from endoscope_core.rig import shipped_rig
from endoscope_nodes.nodes.instrument_model import JointTransforms, section_of
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import COMMAND, EVENT, RESULT, SENSOR_OFFERED
from endoscope_nodes.runtime.recorded_topics import message_class
from endoscope_nodes.runtime.runtime import Runtime

PATIENCE_S = 60.0


class RecordedSession(ProbedRuntime):
    """A recorder, and a node that publishes to it.

    Parameters
    ----------
    overrides
        Parameters of the recorder.
    simulated
        Whether `/clock` gives the time.
    replay
        Parameters of a replay that may be added.
    """

    def __init__(self, *, simulated=False, replay=None, **overrides) -> None:
        arguments = ['--ros-args', '--log-level', 'fatal']
        arguments += ['-p', 'use_sim_time:=true'] if simulated else []
        runtime = Runtime(
            arguments,
            context=Context(),
            domain_id=private_domain(),
            overrides={'recorder': overrides, 'replay': replay or {}},
        )
        self.recorder = runtime.add(RecorderNode)
        super().__init__(runtime, PATIENCE_S)

    def publisher(self, kind: type, topic: str, qos):
        """Publish on a topic once the recorder hears it."""
        publisher = self.probe.create_publisher(kind, topic, qos)
        self.wait(publisher.get_subscription_count)
        # The reader has to find the writer, too.
        self.wait(lambda: dict(self.recorder.extra_readers()).get(publisher.topic_name))
        return publisher

    def wait_for(self, counts: Mapping[str, int]) -> None:
        """Wait until so many messages of topics are recorded, or more."""

        def recorded() -> bool:
            found = self.recorder.bags.session.report().counts
            return all(found[topic] >= count for topic, count in counts.items())

        self.wait(recorded)

    def close(self):
        """End the recording like a process does, and return its report."""
        super().close()
        return self.recorder.last_report


SERVO = '/endoscope/motor/servo_jp'
WIRES = '/endoscope/wires/measured_js'
TRACKER = '/endoscope/tracker/measured_cp'
CLUTCH = '/endoscope/master/clutch'
STATE = '/endoscope/slave/operating_state'
SESSION = '/endoscope/slave/motion_session'
JOINT_STATES = '/endoscope/joint_states'
TRANSFORMS = '/tf'
DIAGNOSTICS = '/diagnostics'
TIP_VELOCITY = '/endoscope/slave/servo_cv'
N = 400


def record_all_types(path: Path):
    """Record one of each kind of topic; return what was sent by topic, and the report.

    The state is published before the recorder starts, as latched states are.
    """
    section = section_of(shipped_rig().instrument)
    joints, encoder = section.joint_names, JointTransforms(section)
    topics = (SERVO, WIRES, TRACKER, CLUTCH, STATE, SESSION, JOINT_STATES, TRANSFORMS)
    sent = {topic: [] for topic in topics}
    with RecordedSession(bag=str(path), autostart=False) as session:
        state = session.probe.create_publisher(String, STATE, RESULT)
        state.publish(String(data='ENABLED'))
        sent[STATE].append('ENABLED')
        session.serve(0.2)
        session.recorder.start()
        session.wait(state.get_subscription_count)
        servo = session.publisher(JointState, SERVO, COMMAND)
        wires = session.publisher(JointState, WIRES, SENSOR_OFFERED)
        tracker = session.publisher(PoseStamped, TRACKER, SENSOR_OFFERED)
        clutch = session.publisher(Joy, CLUTCH, EVENT)
        motion = session.publisher(Header, SESSION, EVENT)
        angles = session.publisher(JointState, JOINT_STATES, SENSOR_OFFERED)
        links = session.publisher(message_class(TF_MESSAGE), TRANSFORMS, SENSOR_OFFERED)
        diagnostics = session.publisher(DiagnosticArray, DIAGNOSTICS, EVENT)
        diagnostics.publish(DiagnosticArray())
        session.publisher(TwistStamped, TIP_VELOCITY, COMMAND).publish(TwistStamped())

        def publish() -> None:
            k = len(sent[SERVO])
            if k == N:
                return
            now = time.time_ns()
            sent[SERVO].append((now, [0.5 * k, -k]))
            servo.publish(encode_joint_state(['motor_x', 'motor_y'], now, position=[0.5 * k, -k]))
            tensions = [5.0 + k, 5.0 - k]
            sent[WIRES].append((now, tensions))
            wires.publish(encode_joint_state(['wire_x_pos', 'wire_x_neg'], now, effort=tensions))
            if k % 25 == 0:
                sent[TRACKER].append((now, [k, 0.1, 0.2]))
                pose = encode_poses([now], [[k, 0.1, 0.2]], [[0, 0, 0, 1]], frame_id='base')
                tracker.publish(pose[0])
                bent = [1e-4 * k] * len(joints)
                sent[JOINT_STATES].append((now, bent))
                angles.publish(encode_joint_state(joints, now, position=bent))
                sent[TRANSFORMS].append((now, bent))
                links.publish(encoder.encode(now, bent))
            if k % 100 == 0:
                sent[CLUTCH].append(k // 100 % 2)
                clutch.publish(Joy(buttons=[k // 100 % 2]))
                sent[SESSION].append(f'session-{k}')
                motion.publish(Header(frame_id=sent[SESSION][-1]))

        session.probe.create_timer(0.001, publish)
        session.wait(lambda: len(sent[SERVO]) == N)
        session.wait_for({topic: len(messages) for topic, messages in sent.items()})
        report = session.recorder.stop()
    return sent, report
