"""Which topic of a bag tells what the shafts were sent to."""

from endoscope_bags.recording import Recording as Bag
from endoscope_explain.recording.series import COMMAND, DESIRED, SETPOINT

INPUTS = (SETPOINT, COMMAND, DESIRED)
"""The nearest to the shafts first.

A setpoint says what the motor driver made of commands: which it obeyed, how it bounded them, and
the pose that it held once they had ended.
"""


def input_topic(bag: Bag, namespace: str | None = None) -> str:
    """The plant's input, the nearest to the shafts that was recorded; empty where none was."""
    return next((topic for topic in INPUTS if bag.has(topic, namespace)), '')
