"""The beat of the handle, turned by a test; nothing is sent by it."""

from collections import deque
from dataclasses import replace

from rclpy.node import Node

from endoscope_console.beat import Beat, Situation
from endoscope_console.teleop.frames import InputFrame
from endoscope_console.teleop.operator import DeadManState
from endoscope_console.teleop.pad import PadHandle

MS = 1_000_000
NEUTRAL = InputFrame(False, False, True, True, False, 0, 1, 0, 1, 0.0, 0.0, 0.0)


class UntilTheLast(deque):
    """Arrivals; taking the last of them triggers a change."""

    def __init__(self, change):
        super().__init__()
        self._change = change

    def popleft(self):
        arrival = super().popleft()
        if not self:
            self._change()
        return arrival


def beat_of(situation):
    beat = Beat(Node.__new__(Node), PadHandle(2, ((0.5, 1.0),) * 2, (3.0, 3.0)))
    beat.situation = situation
    return beat


def test_a_picture_that_was_made_and_seen_while_the_beat_was_held_up_is_known():
    made = ((1, 0),)
    beat = beat_of(Situation('c1', True, source='master', pictures=made))
    beat._turn(MS)
    beat.hear('c1', NEUTRAL, 2 * MS)
    beat._turn(2 * MS)
    beat.hear('c1', replace(NEUTRAL, seq=2, pressed=True, grip=1, t=0.001), 3 * MS)
    beat._turn(3 * MS)
    assert beat.report.state is DeadManState.ENGAGED

    def a_picture_is_made():
        beat.situation = replace(beat.situation, pictures=(*made, (2, 4 * MS)))

    beat._arrivals = UntilTheLast(a_picture_is_made)
    beat.hear('c1', replace(NEUTRAL, seq=3, pressed=True, grip=1, seen=2, t=0.002), 4 * MS)
    beat._turn(4 * MS)
    assert beat.report.state is DeadManState.ENGAGED
