"""Stamps that count milliseconds or microseconds where they say seconds, or the other way round."""

from collections.abc import Mapping
from dataclasses import replace
from math import log

import numpy as np

from endoscope_core.physics.description import SensorParameters
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.recording import Recording, Series
from endoscope_explain.recording.series import BENDING, MOTOR, WIRES

MOTOR_RATE_HZ = 1000.0
"""At which a simulated motor is read, and a quick bus."""
UNITS = {1: 'ms', 2: 'us', 3: 'ns'}
"""By how many powers of a thousand a second is more."""
NEAR = 10.0
"""Factor within which sensors are read as described: none of them once in 0.4 s or more."""
AS_LONG = 4.0
"""Factor within which topics of one recording are equally long."""


def stamp_unit_findings(recording: Recording, sensors: SensorParameters) -> list[Finding]:
    """Topics whose stamps are a power of 1000 off: to be divided by `evidence['per_second']`."""
    topics = {s.topic: s for s in (recording.command, *recording.measured().values())}
    # A sensor's rate alone tells it where all topics agree; where one is as much longer or shorter
    # than the others, that does.
    powers = _powers(topics, sensors)
    return [
        _finding(recording, [topics[t] for t in powers if powers[t] == power], power)
        for power in dict.fromkeys(powers.values())
    ]


def in_seconds(recording: Recording, findings: list[Finding]) -> Recording:
    """Return the recording with the stamps of the found topics as they must be meant."""
    divisors = {topic: f.evidence['per_second'] for f in findings for topic in f.signals}
    every = {'command': recording.command, **recording.measured()}
    return recording.with_series(
        {
            name: replace(s, time=s.time / divisors[s.topic], received=None)
            for name, s in every.items()
            if s.topic in divisors
        }
    )


def _powers(topics: Mapping[str, Series], sensors: SensorParameters) -> dict[str, int]:
    rates = {
        MOTOR: MOTOR_RATE_HZ,
        WIRES: sensors.load_cell_rate,
        BENDING: sensors.tracker_rate,
    }
    long = {topic: float(np.ptp(s.time)) for topic, s in topics.items() if len(s.time) > 2}
    by_rate = {
        topic: _power(rates[topic] * float(np.median(np.diff(topics[topic].time))), NEAR)
        for topic in long
        if topic in rates
    }
    by_receipt = {topic: _by_receipt(topics[topic]) for topic in long}
    if not by_rate:
        return {}
    all_alike = set(by_rate.values())
    found = {}
    for topic, span in long.items():
        known = by_receipt[topic]
        if known is not None:
            found[topic] = known
            continue
        others = float(np.median([other for name, other in long.items() if name != topic]))
        beside = _power(span / others, AS_LONG)
        if len(all_alike) == 1 and (common := next(iter(all_alike))):
            # All sensors are as far from their rates; the command may be as they are, or right.
            measured = float(np.median([long[name] for name in by_rate]))
            found[topic] = common + _power(span / measured, AS_LONG)
        elif beside and by_rate.get(topic, beside) == beside:
            found[topic] = beside
    return {topic: power for topic, power in found.items() if power}


def _by_receipt(series: Series) -> int | None:
    """Power of a thousand by which stamps run faster than the recorder's clock; None if unknown."""
    if series.received is None:
        return None
    received = float(np.ptp(series.received))
    delay = series.received - series.time
    if received <= 0.0 or np.ptp(delay) < 1e-6:
        # A table was converted: its stamps were taken for times of receipt.
        return None
    return _power(float(np.ptp(series.time)) / received, AS_LONG)


def _power(ratio: float, near: float) -> int:
    """Power of a thousand that a ratio is near to; 0 where it is near none."""
    if ratio <= 0.0:
        return 0
    power = round(log(ratio) / log(1e3))
    return power if abs(power) in UNITS and abs(log(ratio) - power * log(1e3)) < log(near) else 0


def _finding(recording: Recording, series: list[Series], power: int) -> Finding:
    step = float(np.median(np.diff(series[0].time)))
    topics = tuple(one.topic for one in series)
    named = f'the stamps of {" and ".join(topics)}'
    seen = f'{step:.3g} s apart in {float(np.ptp(series[0].time)):.4g} s'
    unit = UNITS[abs(power)]
    if power > 0:
        text = f'{named} are {seen}: they are in {unit}, not in s'
        remedy = f'divide them by {1000**power:g}'
    else:
        text = f'{named} are {seen}: they are in s and were taken for {unit}'
        remedy = f'multiply them by {1000**-power:g}'
    return Finding(
        'wrong_unit',
        Severity.MISTAKE,
        recording.joints[0],
        'recording',
        topics,
        ((0.0, recording.duration),),
        text,
        remedy + ', or give the unit of time when the table is converted',
        evidence={'per_second': 1000.0**power},
    )
