"""Stamps: out of order, repeated, jittering, missing, of other clocks, or in another unit."""

from collections.abc import Mapping
from dataclasses import replace
from math import log

import numpy as np

from endoscope_core.physics.description import SensorParameters
from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.explanation import NINETY_PERCENT, Estimate
from endoscope_explain.recording import BENDING, MOTOR, WIRES, Array, Recording, Series

GAP_FACTOR = 2.5
"""A gap is at least this many usual sample intervals: one lost sample is not one."""
LEAST_STAMPS = 20
NORMAL_MEDIAN = 0.6745
"""Median of the size of normal noise, in its rms."""
SPEED_WINDOW_S = 0.2


def order_stamps(series: Series, joint: str) -> tuple[Series, list[Finding]]:
    """Sort a series by its stamps and keep the first of equal ones; findings name the joint."""
    findings = []
    step = np.diff(series.time)
    backward = step < 0
    if backward.any():
        worst = float(-step.min())
        # Neighbours that changed places are harmless; a clock that was set back is not.
        severity = Severity.FAULT if worst > 0.1 else Severity.NOTE
        first = float(series.time[1:][backward][0])
        findings.append(
            Finding(
                'unordered_stamps',
                severity,
                joint,
                'recording',
                (series.topic,),
                ((first, first + worst),),
                f'{int(backward.sum())} stamps of {series.topic} run backwards, by {worst:.3f} s '
                f'at most (first at {first:.3f} s)',
                'sorted by stamp',
                evidence={'count': float(backward.sum()), 'worst_s': worst},
            )
        )
    order = np.argsort(series.time, kind='stable')
    time = series.time[order]
    fresh = np.r_[True, np.diff(time) > 0]
    repeats = int((~fresh).sum())
    if repeats:
        at = float(time[~fresh][0])
        findings.append(
            Finding(
                'repeated_stamps',
                Severity.NOTE,
                joint,
                'recording',
                (series.topic,),
                ((at, float(time[~fresh][-1])),),
                f'{repeats} stamps of {series.topic} occur more than once (first at {at:.3f} s)',
                'the first of each was kept',
                evidence={'count': float(repeats)},
            )
        )
    return series.taken(order[fresh]), findings


def jitter_findings(recording: Recording, sensors: SensorParameters) -> list[Finding]:
    """Note topics, as recorded, whose stamps jitter so that readings in motion err beyond noise."""
    noise = {
        'shaft_position': 2.0 * np.pi / sensors.encoder_counts,
        'tension': max(sensors.load_cell_noise, sensors.load_cell_resolution),
        'bending': sensors.tracker_noise,
    }
    findings = []
    for quantity, series in recording.measured().items():
        if not noise.get(quantity) or len(series.time) < LEAST_STAMPS:
            continue
        step = np.diff(series.time)
        # A stamp with white jitter is off the middle of its neighbours by the root of 1.5 times as
        # much; the median ignores pauses.
        off_middle = 0.5 * np.abs(np.diff(step))
        jitter = float(np.median(off_middle)) / NORMAL_MEDIAN / np.sqrt(1.5)
        error = jitter * _speed(series)
        if error > noise[quantity]:
            findings.append(
                Finding(
                    'jittering_stamps',
                    Severity.NOTE,
                    recording.joints[0],
                    'recording',
                    (series.topic,),
                    ((0.0, recording.duration),),
                    f'stamps of {series.topic} jitter by {1e3 * jitter:.3g} ms (rms): in motion '
                    f'readings err by {error / noise[quantity]:.2g} times their noise',
                    'nothing was put right: stamp readings when they are taken, not received',
                    evidence={'jitter_s': jitter},
                )
            )
    return findings


def _speed(series: Series) -> float:
    """How fast the quickest column of a series changes (rms), per s."""
    order = np.argsort(series.time, kind='stable')
    grid = np.arange(series.time.min(), series.time.max(), SPEED_WINDOW_S)
    columns = series.values.reshape(len(series.time), -1)[order].T
    moved = np.array([np.diff(np.interp(grid, series.time[order], c)) for c in columns])
    return float(np.sqrt(np.mean(moved**2, axis=1).max())) / SPEED_WINDOW_S if moved.size else 0.0


def usual_interval(time: Array) -> float:
    """Return the median interval of increasing stamps in s."""
    return float(np.median(np.diff(time)))


def find_gaps(series: Series, start: float, end: float) -> tuple[tuple[float, float], ...]:
    """From the last sample before to the first one after each gap, in s."""
    usual = usual_interval(series.time)
    step = np.diff(series.time)
    # A stream that jitters as a matter of course is not full of gaps.
    threshold = max(GAP_FACTOR * usual, 3.0 * float(np.quantile(step, 0.99)))
    at = np.flatnonzero(step > threshold)
    gaps = [(float(series.time[i]), float(series.time[i + 1])) for i in at]
    # A topic that begins late or ends early in the recording has a gap there, too.
    margin = max(threshold, 0.1)
    if series.time[0] - start > margin:
        gaps.insert(0, (start, float(series.time[0])))
    if end - series.time[-1] > margin:
        gaps.append((float(series.time[-1]), end))
    return tuple(gaps)


def missing_in(
    series: Series, gaps: tuple[tuple[float, float], ...]
) -> tuple[tuple[float, float], ...]:
    """Gaps in which samples were lost, or may have been: a source may also have paused."""
    if series.lost is None:
        return gaps
    after = np.searchsorted(series.time, [b for _, b in gaps])
    # What ends early or begins late has lost nothing that is known of.
    lost = np.append(series.lost, 0)[np.where(after > 0, after, len(series.lost))]
    return tuple(gap for gap, count in zip(gaps, lost, strict=True) if count)


def silence_findings(
    gaps: dict[str, tuple[tuple[float, float], ...]],
    missing: dict[str, tuple[tuple[float, float], ...]],
    joint: str,
) -> list[Finding]:
    """Note where topics were silent although nothing was lost."""
    silent = {t: [gap for gap in found if gap not in missing[t]] for t, found in gaps.items()}
    every = sorted(gap for found in silent.values() for gap in found)
    if not every:
        return []
    topics = tuple(topic for topic, found in silent.items() if found)
    longest = max(b - a for a, b in every)
    return [
        Finding(
            'source_paused',
            Severity.NOTE,
            joint,
            'recording',
            topics,
            tuple(every),
            f'{", ".join(topics)} paused ({len(every)} times, up to {longest:.3f} s): nothing was '
            'lost',
            'nothing is judged where there are no samples',
            evidence={'count': float(len(every)), 'longest_s': longest},
        )
    ]


def gap_findings(
    gaps_by_topic: dict[str, tuple[tuple[float, float], ...]],
    intervals: dict[str, float],
    joint: str,
) -> list[Finding]:
    """At most one `recording_gap`, of all topics, whose `time_s` is where the longest begins."""
    every = [(b - a, a, b, topic) for topic, gaps in gaps_by_topic.items() for a, b in gaps]
    if not every:
        return []
    every.sort(reverse=True)
    length, begin, _, topic = every[0]
    topics = tuple(dict.fromkeys(item[3] for item in every))
    usual = intervals[topic]
    # The first missing sample was due between one interval after the last sample and that sample.
    onset = Estimate(begin + 0.5 * usual, begin, begin + usual, 's')
    missing = {t: sum(b - a - intervals[t] for a, b in g) for t, g in gaps_by_topic.items() if g}
    return [
        Finding(
            showing(Symptom.MISSING_SAMPLES).id,
            Severity.FAULT,
            joint,
            'recording',
            topics,
            tuple(sorted({(a, b) for _, a, b, _ in every})),
            f'samples of {", ".join(topics)} are missing: the longest gap lasts {length:.3f} s '
            f'from {begin:.3f} s',
            'nothing is judged where samples are missing',
            parameters={
                'time_s': onset,
                'duration_s': Estimate(length - usual, max(length - 2 * usual, 0.0), length, 's'),
            },
            evidence={'gaps': float(len(every)), 'missing_s': float(sum(missing.values()))},
        )
    ]


WINDOW_S = 1.0


def delay_slope(series: Series) -> tuple[float, float] | None:
    """Drift of receipt against stamp and its standard error in s/s, None if it is unknown."""
    if series.received is None or series.time[-1] - series.time[0] < 5 * WINDOW_S:
        return None
    delay = series.received - series.time
    # The quickest deliveries of each second tell the drift.
    window = ((series.time - series.time[0]) / WINDOW_S).astype(int)
    slope, error = 0.0, np.inf
    # Against a drift the quickest delivery is the window's last or first: it is taken out first.
    for _ in range(3):
        flat = delay - slope * series.time
        quickest = np.array(
            [
                np.flatnonzero(window == w)[np.argmin(flat[window == w])]
                for w in np.unique(window)[:-1]
            ]
        )
        time = series.time[quickest] - series.time[quickest].mean()
        slope = float(time @ delay[quickest] / (time @ time))
        rest = delay[quickest] - delay[quickest].mean() - slope * time
        # Rounding of receipt times would otherwise pass for a precision that nobody has.
        error = max(float(np.std(rest, ddof=2)), 1e-6) / float(np.sqrt(time @ time))
    return slope, error


def clock_skew_from_receipt(series: dict[str, Series]) -> dict[str, Estimate]:
    """Skew (relative rate minus one) of topics whose clock surely runs apart from most."""
    slopes = {t: s for t, one in series.items() if (s := delay_slope(one)) is not None}
    if len(slopes) < 3:
        return {}
    usual = float(np.median([slope for slope, _ in slopes.values()]))
    found = {}
    for topic, (slope, error) in slopes.items():
        apart = slope - usual
        if abs(apart) > max(6.0 * error, 3e-5):
            skew = -apart / (1.0 + apart)
            reach = NINETY_PERCENT * error
            found[topic] = Estimate(skew, skew - reach, skew + reach, '-')
    return found


def retimed(series: Series, skew: float, start: float = 0.0) -> Series:
    """Put a series on the common clock; its own ran `1 + skew` times as fast from `start` s."""
    time: Array = start + (series.time - start) / (1.0 + skew)
    return replace(series, time=time)


def skew_finding(topic: str, joint: str, skew: Estimate, duration: float) -> Finding:
    """Describe the `clock_skew` of the device behind one topic."""
    way = 'fast' if skew.value > 0 else 'slow'
    deviation = (skew.high - skew.low) / (2.0 * NINETY_PERCENT)
    return Finding(
        showing(Symptom.CLOCK_RATE).id,
        Severity.FAULT,
        joint,
        'recording',
        (topic,),
        ((0.0, duration),),
        f'the clock behind {topic} runs {way} by {abs(skew.value) * 1e3:.3f} ms in a second',
        'its stamps were put on the common clock',
        parameters={'skew': skew},
        evidence={'z': abs(skew.value) / max(deviation, 1e-12)},
    )


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
        _unit_finding(recording, [topics[t] for t in powers if powers[t] == power], power)
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


def _unit_finding(recording: Recording, series: list[Series], power: int) -> Finding:
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
