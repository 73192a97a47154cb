"""A rig of another simulator: sliding nodes, and laws whose forms are not those of the catalogue.

Explaining a recording of the kernel's own laws is an inverse crime (Colton, Kress, Inverse Acoustic
and Electromagnetic Scattering Theory, 1992), since the search contains the exact laws. Here the
wires are rows of springs, the parameters of the rig have the same names, and every law has another
form.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from endoscope_core.physics import JointParameters
from endoscope_lab.concealed import sliding_nodes
from endoscope_lab.concealed.readings import TRACKER_TICKS, Readings
from endoscope_lab.concealed.sliding_nodes import Acting

Array = NDArray[np.float64]
Generator = np.random.Generator

TICK = 1e-3
"""Time step of commands and servo, s."""
EVERY = 5
"""Ticks in a time step of the wires, which have no inertia and hardly reverse within 5 ms."""
NODES, FEW_NODES = 100, 12
"""Nodes of a wire, for recordings and for finding the strength of a law.

Just after a reversal the spring at a wire's end follows a chord of the true curve. Compared with a
continuous sheath, the tensions of a commissioning motion differ by 0.020 N (rms) with 30 nodes, as
much as a cell's noise, by 0.0038 N with 100, and by 0.0035 N, due to the ticks, with 300.
"""


@dataclass(frozen=True)
class Laws:
    """Laws of a rig beyond its nominal physics; none by default."""

    late_s: float = 0.0  # delay of commands
    play_rad: float = 0.0  # between the gear's flanks
    # The pulley runs ahead by eccentric_rad (sin(cycles shaft + phase) - sin phase).
    eccentric_rad: float = 0.0
    eccentric_cycles: float = 1.0
    eccentric_phase: float = 0.0
    # The motor also turns a gear: drag_nm (2 / pi) atan(speed / drag_speed), N m and rad/s.
    drag_nm: float = 0.0
    drag_speed: float = 1.0
    # The exponent is 1 + sticking / (1 + (v / sticking_speed)^1.5) times as large where the wire is
    # wound at v, m/s.
    sticking: float = 0.0
    sticking_speed: float = 1.0
    # The exponent grows by the share bent_anew around a time, as a hyperbolic tangent.
    bent_anew: float = 0.0
    bent_at_s: float = 0.0
    bent_within_s: float = 1.0
    # The exponent is larger by the share running_in / (1 + d / running_in_m)^2 after a wound
    # distance d.
    running_in: float = 0.0
    running_in_m: float = 1.0
    # See `Acting`.
    weight_nm: float = 0.0
    weight_rad: float = 0.0
    stop_rad: float = math.inf
    stop_stiffness: float = 0.0
    # Moment of breathing that dwells at the end: breath_nm (1 - 2 |cos|^3) of half the cycle
    # (Lujan et al., Med. Phys. 26, 1999).
    breath_nm: float = 0.0
    breath_hz: float = 1.0
    breath_phase: float = 0.0
    # Moment from a time on, as a hyperbolic tangent.
    push_nm: float = 0.0
    push_at_s: float = 0.0
    push_within_s: float = 1.0
    filter_s: float = 0.0  # window of the tracker's moving average
    # The tracker adds field_rad (1 - exp(-(angle / field_width)^2)).
    field_rad: float = 0.0
    field_width: float = 1.0
    # The first cell has this gain and drifts by warming_n (1 - exp(-t / warming_s)); both cells
    # read a share of their neighbour.
    gain: float = 1.0
    warming_n: float = 0.0
    warming_s: float = 1.0
    neighbour: float = 0.0


@dataclass(frozen=True)
class Form:
    """How a law is drawn."""

    words: str  # plain description
    strength: str  # field of `Laws` that sets its strength
    begin: float  # offset of that field from zero strength, at the start of the search
    # Ranges in which its other numbers are drawn, log-uniformly, phases uniformly.
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # The same as shares of the recording's length, and of the largest angle of the tip.
    within: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    reached: Mapping[str, tuple[float, float]] = field(default_factory=dict)


_TURN = (-math.pi, math.pi)
_HALF = (0.25, 0.7)

FORMS: dict[str, Form] = {
    'transport_delay': Form('commands take effect late', 'late_s', 0.02),
    'gear_backlash': Form('play between the flanks of the gear', 'play_rad', 0.08),
    'cogging': Form(
        'an eccentric wheel in the gear',
        'eccentric_rad',
        0.03,
        {'eccentric_cycles': (4.0, 20.0), 'eccentric_phase': _TURN},
    ),
    'gear_friction': Form('the gear drags', 'drag_nm', 0.005, {'drag_speed': (0.02, 0.1)}),
    'stribeck_friction': Form(
        'the sheath sticks at low speed', 'sticking', 0.5, {'sticking_speed': (3e-4, 2e-3)}
    ),
    'configuration_change': Form(
        'the tube is bent again during the recording',
        'bent_anew',
        0.3,
        {'bent_within_s': (0.05, 0.5)},
        {'bent_at_s': _HALF},
    ),
    'friction_run_in': Form(
        'the sheath runs in', 'running_in', 0.5, {'running_in_m': (0.005, 0.03)}
    ),
    'gravity': Form('a weight on the tip', 'weight_nm', 1e-3, {'weight_rad': _TURN}),
    'joint_stop': Form(
        'the section comes to a round stop',
        'stop_stiffness',
        0.05,
        reached={'stop_rad': (0.4, 0.8)},
    ),
    'breathing': Form(
        'the patient breathes', 'breath_nm', 5e-4, {'breath_hz': (0.15, 0.5), 'breath_phase': _TURN}
    ),
    'external_load': Form(
        'an external force starts to push at the tip',
        'push_nm',
        8e-4,
        {'push_within_s': (0.02, 0.2)},
        {'push_at_s': _HALF},
    ),
    'tracker_delay': Form('the tracker reports a moving average', 'filter_s', 0.08),
    'tracker_distortion': Form(
        'metal bends the field of the tracker',
        'field_rad',
        0.05,
        reached={'field_width': (0.3, 1.2)},
    ),
    'load_cell_gain': Form('a load cell has a wrong gain', 'gain', 0.1),
    'load_cell_drift': Form('a load cell warms up', 'warming_n', 0.5, {'warming_s': (20.0, 60.0)}),
    'load_cell_crosstalk': Form('load cells also read their neighbour', 'neighbour', 0.08),
}
"""Forms by the effect of the catalogue that is their right name."""


def drawn_laws(
    generator: Generator, name: str, duration: float, reached: float
) -> Callable[[float], Laws]:
    """Draw a law except for its strength, for a duration in s and a largest angle in rad."""
    # A strength of zero is no law, a strength of one is its `begin`.
    form = FORMS[name]
    chosen: dict[str, Any] = {}
    for key, ends in form.ranges.items():
        even = min(ends) < 0.0
        drawn = generator.uniform(*(ends if even else np.log(ends)))
        chosen[key] = float(drawn if even else np.exp(drawn))
    for whole, shares in ((duration, form.within), (reached, form.reached)):
        chosen |= {key: whole * float(generator.uniform(*ends)) for key, ends in shares.items()}
    nothing = getattr(Laws(), form.strength)

    def laws(strength: float) -> Laws:
        return replace(Laws(), **chosen, **{form.strength: nothing + strength * form.begin})

    return laws


def read(joint: JointParameters, laws: Laws, command: Array, nodes: int = NODES) -> Readings:
    """Readings of a rig of one joint without noise, for shaft commands (N, 1) in rad, every ms."""
    numbers: dict[str, Any] = asdict(joint)
    time = np.arange(len(command), dtype=np.float64) * TICK
    asked = _late(command[:, 0], laws.late_s)
    shaft = sliding_nodes.motor_angle(numbers, asked, TICK)
    pulley = _pulley(shaft, laws)
    rows = slice(None, None, EVERY)
    acting = _acting(numbers['pulley_radius'], pulley[rows], time[rows], laws)
    at_motor, _, angle = sliding_nodes.follow(numbers, pulley[rows], EVERY * TICK, nodes, acting)
    tension = np.stack([np.interp(time, time[rows], wire) for wire in at_motor.T], axis=1)
    speed = np.gradient(shaft, TICK)
    drag = laws.drag_nm * (2.0 / math.pi) * np.arctan(speed / laws.drag_speed)
    effort = numbers['pulley_radius'] * (tension[:, 0] - tension[:, 1]) + drag
    stamps = time[::TRACKER_TICKS]
    return Readings(
        time,
        stamps,
        command,
        shaft[:, None],
        speed[:, None],
        effort[:, None],
        _cells(tension, time, laws)[:, None],
        _tracker(np.interp(time, time[rows], angle), laws)[::TRACKER_TICKS, None],
    )


def _late(command: Array, late_s: float) -> Array:
    time = TICK * np.arange(len(command))
    return np.interp(time - late_s, time, command)


def _pulley(shaft: Array, laws: Laws) -> Array:
    """Angle of the pulley, driven by one flank or the other, and by an eccentric wheel."""
    pulley, at = np.empty_like(shaft), shaft[0]
    half = 0.5 * laws.play_rad
    for k, angle in enumerate(shaft.tolist()):
        at = min(max(at, angle - half), angle + half)
        pulley[k] = at
    wheel = laws.eccentric_cycles * pulley + laws.eccentric_phase
    return pulley + laws.eccentric_rad * (np.sin(wheel) - math.sin(laws.eccentric_phase))


def _acting(radius: float, pulley: Array, time: Array, laws: Laws) -> Acting:
    wound = radius * np.abs(np.diff(pulley, prepend=pulley[0]))
    speed = wound / (time[1] - time[0])
    rubbing = 1.0 + laws.sticking / (1.0 + (speed / laws.sticking_speed) ** 1.5)
    rubbing *= 1.0 + laws.bent_anew * _step(time, laws.bent_at_s, laws.bent_within_s)
    rubbing *= 1.0 + laws.running_in / (1.0 + np.cumsum(wound) / laws.running_in_m) ** 2
    breath = math.pi * laws.breath_hz * time + laws.breath_phase
    moment = laws.breath_nm * (1.0 - 2.0 * np.abs(np.cos(breath)) ** 3)
    moment += laws.push_nm * _step(time, laws.push_at_s, laws.push_within_s)
    return Acting(
        np.maximum(rubbing, 0.0),
        moment,
        laws.weight_nm,
        laws.weight_rad,
        laws.stop_rad,
        laws.stop_stiffness,
    )


def _step(time: Array, at: float, within: float) -> Array:
    return 0.5 * (1.0 + np.tanh((time - at) / within))


def _tracker(angle: Array, laws: Laws) -> Array:
    count = round(laws.filter_s / TICK)
    if count > 1:
        # A causal mean, of past values.
        angle = uniform_filter1d(angle, count, mode='nearest', origin=(count - 1) // 2)
    return angle + laws.field_rad * (1.0 - np.exp(-((angle / laws.field_width) ** 2)))


def _cells(tension: Array, time: Array, laws: Laws) -> Array:
    read = tension + laws.neighbour * tension[:, ::-1]
    warmth = laws.warming_n * (1.0 - np.exp(-time / laws.warming_s))
    read[:, 0] = laws.gain * read[:, 0] + warmth
    return read
