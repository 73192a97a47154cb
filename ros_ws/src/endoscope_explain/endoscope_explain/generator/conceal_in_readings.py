"""Concealed faults of sensors and of the recording."""

from endoscope_explain.generator.concealment import Comparable, Effect, Setting

DEVICES = ('slave/measured_js', 'wires/measured_js', 'motor/measured_js')


def _any_cell(s: Setting) -> tuple[int, int]:
    """Index of one load cell of the joint, and of the antagonist's."""
    first = 2 * s.joint
    return (first, first + 1) if s.rng.random() < 0.5 else (first + 1, first)


def _tracker_bias(s: Setting) -> Comparable:
    bias = s.strength * s.either_sign(0.03, 0.10)
    s.faults.bias[s.joint] = bias
    return {'bias_rad': bias}


def _tracker_distortion(s: Setting) -> Comparable:
    s.faults.distortion[s.joint] = (
        s.strength * s.within(0.03, 0.07),
        s.within(2.5, 5.0),
        s.within(0.0, 6.28),
    )
    return {}


def _tracker_delay(s: Setting) -> Comparable:
    delay = s.strength * s.within(0.03, 0.10)
    s.faults.tracker_delay[:] = delay
    return {'delay_s': delay}


def _tracker_drift(s: Setting) -> Comparable:
    whole = s.strength * (
        s.either_sign(0.06, 0.16) if s.duration > 20.0 else s.either_sign(0.04, 0.10)
    )
    s.faults.drift[s.joint] = whole / s.duration
    s.faults.drift_bow[s.joint] = s.within(-0.2, 0.2)
    return {'rate_rad_per_s': whole / s.duration}


def _tracker_outliers(s: Setting) -> Comparable:
    s.faults.outlier_share = s.within(0.012, 0.04)
    s.faults.outlier_size = s.strength * s.within(0.3, 0.8)
    return {}


def _load_cell_drift(s: Setting) -> Comparable:
    cell, _ = _any_cell(s)
    whole = s.strength * (s.either_sign(0.5, 1.5) if s.duration > 20.0 else s.either_sign(0.3, 0.8))
    s.faults.cell_drift[cell] = whole / s.duration
    return {'rate_n_per_s': whole / s.duration}


def _load_cell_gain(s: Setting) -> Comparable:
    cell, _ = _any_cell(s)
    gain = 1.0 + s.strength * s.either_sign(0.07, 0.2)
    s.faults.cell_mixing[cell, cell] = gain
    return {'gain': gain}


def _load_cell_crosstalk(s: Setting) -> Comparable:
    cell, neighbour = _any_cell(s)
    s.faults.cell_mixing[cell, neighbour] = s.strength * s.either_sign(0.05, 0.15)
    return {}


def _load_cell_saturation(s: Setting) -> Comparable:
    cell, _ = _any_cell(s)
    limit = s.beyond(s.within(0.6, 0.85), s.peaks.tension[cell - 2 * s.joint])
    s.faults.cell_limit[cell] = limit
    return {'limit_n': limit}


def _clock_skew(s: Setting) -> Comparable:
    device = DEVICES[int(s.rng.choice(3, p=(0.6, 0.25, 0.15)))]
    skew = s.strength * s.either_sign(0.06, 0.2) / s.duration
    s.faults.skew[device] = skew
    return {'skew': skew}


def _recording_gap(s: Setting) -> Comparable:
    device = DEVICES[int(s.rng.integers(3))]
    length = s.strength * s.within(0.4, 1.5)
    if device == 'slave/measured_js':
        length = max(length, 0.12)
    begin = s.within(0.2, 0.8) * s.duration
    s.faults.gap = (device, begin, length)
    return {'time_s': begin}


READING_EFFECTS = (
    Effect('tracker_bias', 'sensing', _tracker_bias, 'Constant offset; Franz et al. 2014'),
    Effect(
        'tracker_distortion',
        'sensing',
        _tracker_distortion,
        'One Fourier component of the field map; Kindratenko 2000, Virtual Reality 5(3)',
    ),
    Effect(
        'tracker_delay',
        'sensing',
        _tracker_delay,
        'Pure delay of the tracker as a whole; Franz et al. 2014, IEEE TMI 33(8)',
        of_a_device=True,
    ),
    Effect(
        'tracker_drift',
        'sensing',
        _tracker_drift,
        'Slightly bowed ramp; Franz et al. 2014, IEEE TMI 33(8)',
    ),
    Effect(
        'tracker_outliers',
        'sensing',
        _tracker_outliers,
        'Wrong poses, in both angles at once; contamination of Huber 1964, Ann. Math. Stat. 35(1)',
        of_a_device=True,
    ),
    Effect('load_cell_drift', 'sensing', _load_cell_drift, 'Zero ramp; OIML R 60-1, 2017'),
    Effect('load_cell_gain', 'sensing', _load_cell_gain, 'Span error; OIML R 60-1, 2017'),
    Effect(
        'load_cell_crosstalk',
        'sensing',
        _load_cell_crosstalk,
        'Off-diagonal element of the calibration matrix; Cao et al. 2007',
    ),
    Effect('load_cell_saturation', 'sensing', _load_cell_saturation, 'Clipping converter'),
    Effect(
        'clock_skew',
        'recording',
        _clock_skew,
        'Linear clock; Moon, Skelly, Towsley 1999, IEEE INFOCOM',
        of_a_device=True,
    ),
    Effect(
        'recording_gap',
        'recording',
        _recording_gap,
        'Missing messages of one device',
        of_a_device=True,
    ),
)
