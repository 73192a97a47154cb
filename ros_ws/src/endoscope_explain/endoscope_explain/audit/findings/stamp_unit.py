"""Stamps that are a power of a thousand off: in ms, us or ns, or in s and taken for one of them."""

from dataclasses import replace
from math import log

import numpy as np

from endoscope_core.physics.description import SensorParameters
from endoscope_explain.audit.examined import Examined
from endoscope_explain.audit.finding import FindingKind, Severity
from endoscope_explain.recording import BENDING, MOTOR, WIRES, Series

KIND = FindingKind(
    'wrong_unit',
    Severity.MISTAKE,
    'the stamps of {signals} are {step:.3g} s apart in {span:.4g} s: they are in {meant}',
    '{change}, or give the unit of time when the table is converted',
)
MOTOR_RATE_HZ = 1000.0
"""At which a simulated motor is read, and a quick bus."""
UNITS = {1: 'ms', 2: 'us', 3: 'ns'}
"""By how many powers of a thousand a second is more."""
NEAR = 10.0
"""Factor within which sensors are read as described: none of them once in 0.4 s or more."""
AS_LONG = 4.0
"""Factor within which topics of one recording are equally long."""


def find(seen: Examined) -> Examined:
    """Give all stamps in s."""
    every = {'command': seen.recording.command, **seen.recording.measured()}
    topics = {s.topic: s for s in every.values()}
    powers = _powers(topics, seen.plant.sensors)
    recording = seen.recording.with_series(
        {
            name: replace(s, time=s.time / 1000.0 ** powers[s.topic], received=None)
            for name, s in every.items()
            if s.topic in powers
        }
    )
    found = []
    for power in dict.fromkeys(powers.values()):
        signals = [topic for topic in powers if powers[topic] == power]
        time, unit = topics[signals[0]].time, UNITS[abs(power)]
        finding = KIND.found(
            recording,
            signals,
            step=float(np.median(np.diff(time))),
            span=float(np.ptp(time)),
            meant=f'{unit}, not in s' if power > 0 else f's and were taken for {unit}',
            change=f'{"divide" if power > 0 else "multiply"} them by {1000 ** abs(power):g}',
            evidence={'per_second': 1000.0**power},
        )
        found.append(finding)
    return seen.found(*found, recording=recording)


def _powers(topics: dict[str, Series], sensors: SensorParameters) -> dict[str, int]:
    """Powers of a thousand by which the stamps of topics are more than s, where they are."""
    # A sensor's rate alone shows it where all topics agree; where one is as much longer or shorter
    # than the others, that does.
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
    if not by_rate:
        return {}
    all_alike = set(by_rate.values())
    found = {}
    for topic, span in long.items():
        known = _by_receipt(topics[topic])
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
