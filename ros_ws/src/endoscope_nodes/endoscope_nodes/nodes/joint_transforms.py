"""Where the links of the instrument are, as messages, from the angles of its joints."""

from collections.abc import Sequence

from endoscope_bags.cdr_encoding import TransformEncoder
from endoscope_core.kinematics import Vertebrae
from endoscope_core.rig import InstrumentFacts


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
