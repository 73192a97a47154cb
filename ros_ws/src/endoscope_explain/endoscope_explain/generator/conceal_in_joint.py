"""Concealed effects of the bending joint."""

from endoscope_explain.generator.concealment import Comparable, Effect, Setting


def _joint_backlash(s: Setting) -> Comparable:
    gap = s.strength * s.within(0.05, 0.14)
    if s.rng.random() < 0.5:
        s.put(flank_gap=gap)
    else:
        s.put(output_gap=gap)
    return {'gap_rad': gap}


def _joint_stop(s: Setting) -> Comparable:
    reach = max(-s.peaks.lowest, s.peaks.highest)
    angle = s.beyond(s.within(0.5, 0.75), reach)
    s.put(stop_angle=angle, stop_stiffness=s.within(0.1, 0.4), stop_loss=s.within(0.02, 0.1))
    return {'angle_rad': angle}


def _contact(s: Setting) -> Comparable:
    side = 1.0 if s.rng.random() < 0.5 else -1.0
    reach = s.peaks.highest if side > 0.0 else -s.peaks.lowest
    angle = side * s.within(0.25, 0.6) * reach
    s.put(
        contact_side=side,
        contact_angle=angle,
        contact_stiffness=s.strength * s.within(0.02, 0.06),
        contact_power=s.within(1.0, 1.4),
        contact_loss=s.within(0.02, 0.1),
    )
    return {'angle_rad': angle}


def _gravity(s: Setting) -> Comparable:
    s.put(gravity_moment=s.strength * s.within(0.004, 0.009), gravity_phase=s.either_sign(0.3, 1.3))
    return {}


def _external_load(s: Setting) -> Comparable:
    moment, begin = s.strength * s.either_sign(0.004, 0.01), s.moment_in_motion()
    s.put(load_moment=moment, load_time=begin, load_ramp=s.within(0.02, 0.15))
    return {'moment_nm': moment, 'time_s': begin}


def _joint_inertia(s: Setting) -> Comparable:
    # The sinusoid alone never accelerates enough to show less.
    low, high = (1.0e-5, 4.0e-5) if s.duration > 20.0 else (5.0e-5, 1.5e-4)
    s.put(inertia=s.strength * s.within(low, high))
    return {}


def _cross_coupling(s: Setting) -> Comparable:
    s.put(
        coupling=s.strength * s.either_sign(0.006, 0.016),
        coupling_square=s.strength * s.within(-0.003, 0.003),
    )
    return {}


def _breathing(s: Setting) -> Comparable:
    frequency = s.within(0.2, 0.4)
    s.put(
        breathing_moment=s.strength * s.within(0.005, 0.012),
        breathing_frequency=frequency,
        breathing_phase=s.within(0.0, 3.14),
    )
    return {'frequency_hz': frequency}


JOINT_EFFECTS = (
    Effect(
        'joint_backlash',
        'joint',
        _joint_backlash,
        'By a fair coin elastic flanks that carry the load (Nordin, Galic, Gutman 1997) or a play '
        'operator at the tip (Krasnoselskii and Pokrovskii 1989)',
    ),
    Effect(
        'joint_stop',
        'joint',
        _joint_stop,
        'Two-sided elastic stop with dissipation growing with depth; Hunt and Crossley 1975',
    ),
    Effect(
        'contact',
        'joint',
        _contact,
        'Power-law stiffness with dissipation; Hunt and Crossley 1975; Diolaiti et al. 2005',
    ),
    Effect(
        'gravity',
        'joint',
        _gravity,
        'Pendulum moment with an arbitrary mounting angle; Spong, Robot Modeling and Control, 2006',
    ),
    Effect('external_load', 'joint', _external_load, 'Moment that rises along a cubic ramp'),
    Effect(
        'joint_inertia',
        'joint',
        _joint_inertia,
        'Second-order joint; Spong, Robot Modeling and Control, 2006',
    ),
    Effect(
        'cross_coupling',
        'joint',
        _cross_coupling,
        'Moment linear and quadratic in the other angle; Camarillo et al. 2008, IEEE T-RO 24(6)',
    ),
    Effect(
        'breathing',
        'joint',
        _breathing,
        'Even power of a cosine, less its mean; Lujan et al. 1999, Medical Physics 26(5)',
    ),
)
