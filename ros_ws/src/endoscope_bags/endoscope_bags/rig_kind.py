"""Kind of the rig of a recording, from its latched topic."""

from endoscope_bags.errors import MalformedMessageError
from endoscope_bags.message_types import STRING
from endoscope_bags.recording import Recording
from endoscope_core.rig import RigKind, kind_from_text, kind_of_several

RIG_KIND = 'rig/kind'
"""Topic, in whatever namespace, of a std_msgs/String."""


def kind_of_bag(recording: Recording) -> RigKind:
    """Return the kind of a recording's rig: unknown where it has none that is readable.

    With several, as after a change of servos, it is real only if all of them are.
    """
    kinds = []
    for name, topic in recording.topics.items():
        if not f'/{name}'.endswith(f'/{RIG_KIND}') or topic.type != STRING:
            continue
        try:
            kinds += [kind_from_text(message.data) for _, message in recording.decoded(name)]
        except MalformedMessageError:
            kinds.append(RigKind())
    return kind_of_several(kinds)
