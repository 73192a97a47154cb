"""Where the links of the instrument are, as messages, from the angles of its joints."""

from endoscope_bags.cdr_encoding import TransformEncoder
from endoscope_core.kinematics import Vertebrae
from endoscope_core.rig import InstrumentFacts
from endoscope_nodes.joint_stream import JointReader, JointSample


def section_of(instrument: InstrumentFacts) -> Vertebrae:
    """Return the bending section of the instrument that stands on the table."""
    return Vertebrae(instrument.section_length, instrument.base_frame)


class JointTransforms:
    """Turns `joint_states` into `/tf`, which few have the message class of.

    Parameters
    ----------
    section
        Whose joints they are.
    """

    def __init__(self, section: Vertebrae) -> None:
        self._section = section
        self._reader = JointReader(section.joint_names)
        self._encoder = TransformEncoder([(h.parent, h.child) for h in section.hinges])

    def of_sample(self, sample: JointSample) -> bytes:
        """Encode the transforms of one sample."""
        poses = self._section.transforms(sample.position)
        return self._encoder.encode(sample.stamp_ns, [(p.translation, p.rotation) for p in poses])

    def of_message(self, data: bytes) -> bytes:
        """Encode the transforms of one `JointState` in CDR.

        Raises
        ------
        MalformedMessageError
            It is no JointState of the section's joints.
        """
        return self.of_sample(self._reader.read(data))
