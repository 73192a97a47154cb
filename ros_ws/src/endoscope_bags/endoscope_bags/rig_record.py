"""The rig that was recorded, as its recording carries it."""

from endoscope_bags.recording import Recording
from endoscope_core.rig import Rig, rig_as_text, rig_from_text, shipped_rig

_NAME, _KEY = 'endoscope_rig', 'rig.yaml'
"""Of the metadata record, which stands before all messages."""


def rig_record(rig: Rig) -> dict[str, dict[str, str]]:
    """The metadata record of a rig, for a `BagWriter`."""
    return {_NAME: {_KEY: rig_as_text(rig)}}


def copied_rig_record(recording: Recording) -> dict[str, dict[str, str]]:
    """The record that a recording has, for another one that is made of it."""
    return {name: content for name, content in recording.metadata.items() if name == _NAME}


def rig_of_bag(recording: Recording) -> Rig:
    """Return the rig that a recording carries; as shipped where it carries none."""
    text = recording.metadata.get(_NAME, {}).get(_KEY)
    return shipped_rig() if text is None else rig_from_text(text, f'the rig of {recording.path}')
