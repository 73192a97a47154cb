"""Backlash, as slowly and plainly as it can be written."""

import numpy as np


def play(angle, half_gap):
    state, states = 0.0, []
    for value in angle:
        state = min(max(state, value - half_gap), value + half_gap)
        states.append(state)
    return np.array(states)
