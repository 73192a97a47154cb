"""Waiting for what a sensor's driver reads and counts."""

import time

PATIENCE_S = 120.0


def until(condition):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, 'it does not come to it'
        time.sleep(0.005)


def collect(device, readings):
    """Wait for so many readings, or some more, from now on."""
    taken = []
    until(lambda: taken.extend(device.take()) or len(taken) >= readings)
    return taken


def figure(device, name):
    return device.health()[1][name]
