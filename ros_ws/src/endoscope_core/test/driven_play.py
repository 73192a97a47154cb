"""A controller of feedback on a play with gain behind a servo, driven tick by tick."""

from collections import deque

import numpy as np

from endoscope_core.control import AdaptiveBacklashController, TrackerMeasurement

TICK = 1e-3
PERIOD = 25


class DrivenPlay:
    """A play of the joint, seen by a tracker at 40 Hz that may be late by some ticks."""

    def __init__(self, half_gap=0.4, delay=0, active=True):
        self.controller = AdaptiveBacklashController(1)
        if active:
            self.controller.activate()
        self.half_gap = half_gap
        self.motor = self.joint = 0.0
        self.tick = 0
        self._past = deque(maxlen=delay + 1)

    def run(self, seconds, angle_at, tracker=True):
        """Errors of the joint and corrections (N,)."""
        errors, corrections = [], []
        for _ in range(round(seconds / TICK)):
            time = self.tick * TICK
            angle = angle_at(time)
            speed = (angle_at(time + TICK) - angle) / TICK
            self._past.append(self.joint)
            heard = tracker and self.tick % PERIOD == 0 and len(self._past) == self._past.maxlen
            seen = TrackerMeasurement(time - (len(self._past) - 1) * TICK, [self._past[0]])
            measurement = seen if heard else None
            correction = self.controller.step(time, [angle], [speed], measurement)[0]
            self.motor += (angle + correction - self.motor) * TICK / 0.03
            reach = 0.9 * self.motor
            self.joint = min(max(self.joint, reach - self.half_gap), reach + self.half_gap)
            errors.append(self.joint - angle)
            corrections.append(correction)
            self.tick += 1
        return np.array(errors), np.array(corrections)
