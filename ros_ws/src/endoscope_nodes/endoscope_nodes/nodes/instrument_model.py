"""Shows programs that draw robots what the instrument looks like and how it is bent."""

from collections.abc import Sequence

from std_msgs.msg import String

from endoscope_bags.cdr import TransformEncoder
from endoscope_bags.message_types import TF_MESSAGE
from endoscope_core.kinematics import Vertebrae, robot_description
from endoscope_core.rig import InstrumentFacts
from endoscope_nodes import names
from endoscope_nodes.runtime.diagnostics import OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.qos import RESULT, SENSOR_ASKED, SENSOR_OFFERED
from endoscope_nodes.runtime.recorded_topics import message_class
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription

# Every other sample of a tracker of 40 Hz, whatever its clock does.
_PERIOD_NS = 45_000_000


def section_of(instrument: InstrumentFacts) -> Vertebrae:
    """Return the bending section of the instrument that stands on the table."""
    return Vertebrae(instrument.section_length, instrument.base_frame)


class JointTransforms:
    """Writes `/tf`, which few have the message class of, for a section's joints."""

    def __init__(self, section: Vertebrae) -> None:
        self._section = section
        self._encoder = TransformEncoder([(h.parent, h.child) for h in section.hinges])

    def encode(self, stamp_ns: int, angles: Sequence[float]) -> bytes:
        """Encode the transforms at these angles of all joints, in rad."""
        poses = self._section.transforms(angles)
        return self._encoder.encode(stamp_ns, [(p.translation, p.rotation) for p in poses])


class InstrumentModelNode(EndoscopeNode):
    """Publishes ``robot_description`` once, and how the instrument is bent 20 times a second."""

    def __init__(self, context: NodeContext) -> None:
        super().__init__('instrument_model', context)
        self._section = section_of(self.rig.instrument)
        self._last_ns = 0
        self._out_of_reach = 0
        description = String(data=robot_description(self._section))
        for topic in (names.ROBOT_DESCRIPTION, names.ROBOT_DESCRIPTION_OF_ALL):
            self.create_publisher(String, topic, RESULT).publish(description)
        self._joints = JointPublisher(
            self, names.JOINT_STATES, self._section.joint_names, ('position',), SENSOR_OFFERED
        )
        self._transforms = JointTransforms(self._section)
        self._transforms_out = self.create_publisher(
            message_class(TF_MESSAGE), names.TRANSFORMS, SENSOR_OFFERED
        )
        JointSubscription(self, names.SLAVE_MEASURED, names.JOINTS, self._on_bending, SENSOR_ASKED)
        self.diagnostics.add('model', self._report)

    def _on_bending(self, sample: JointSample) -> None:
        if 0 <= sample.stamp_ns - self._last_ns < _PERIOD_NS or not sample.position:
            return
        self._last_ns = sample.stamp_ns
        try:
            angles = self._section.joint_angles(sample.position)
        except ValueError:
            self._out_of_reach += 1
            return
        self._joints.publish(sample.stamp_ns, *angles)
        self._transforms_out.publish(self._transforms.encode(sample.stamp_ns, angles))

    def _report(self) -> Report:
        values = {'published': self._joints.count, 'out of reach': self._out_of_reach}
        return OK, 'showing the measured bending', values
