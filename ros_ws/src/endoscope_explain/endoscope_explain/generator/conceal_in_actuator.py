"""Concealed effects between command and pulley."""

from endoscope_explain.generator.concealment import Comparable, Effect, Setting


def _transport_delay(s: Setting) -> Comparable:
    delay = s.strength * s.within(0.015, 0.05)
    s.put(transport_delay=delay)
    return {'delay_s': delay}


def _actuator_lag(s: Setting) -> Comparable:
    constant = s.strength * s.within(0.02, 0.07)
    s.put(servo_lag=constant)
    return {'time_constant_s': constant}


def _rate_limit(s: Setting) -> Comparable:
    # The sinusoid alone peaks at 0.79 rad/s; steps and chirp reach several times that.
    usual = s.within(0.5, 0.68) if s.peaks.shaft_speed < 1.0 else s.within(0.6, 1.6)
    limit = s.beyond(usual / s.peaks.shaft_speed, s.peaks.shaft_speed)
    if s.rng.random() < 0.5:
        s.put(command_slew=limit)
    else:
        s.put(speed_limit=limit)
    return {'limit_rad_per_s': limit}


def _torque_limit(s: Setting) -> Comparable:
    # Friction makes the torque nearly constant in motion: a lower limit never lets the joint go.
    s.put(torque_limit=s.beyond(s.within(0.94, 0.985), s.peaks.torque))
    return {}


def _gear_backlash(s: Setting) -> Comparable:
    gap = s.strength * s.within(0.03, 0.10)
    s.put(gear_gap=gap)
    return {'gap_rad': gap}


def _cogging(s: Setting) -> Comparable:
    s.put(
        cogging_amplitude=s.strength * s.within(0.008, 0.02),
        cogging_periods=float(s.rng.integers(10, 25)),
        cogging_phase=s.within(0.0, 6.28),
        cogging_second=s.within(-0.35, 0.35),
    )
    return {}


ACTUATOR_EFFECTS = (
    Effect(
        'transport_delay',
        'actuator',
        _transport_delay,
        'Dead time of a sampled fieldbus; Astrom and Wittenmark, Computer-Controlled Systems, 1997',
    ),
    Effect(
        'actuator_lag',
        'actuator',
        _actuator_lag,
        'First-order prefilter, solved exactly; Ellis, Control System Design Guide, 2012',
    ),
    Effect(
        'rate_limit',
        'actuator',
        _rate_limit,
        'By a fair coin a slewed command (Rundqwist 1996) or a clamped speed loop (Ellis 2012)',
    ),
    Effect(
        'torque_limit',
        'actuator',
        _torque_limit,
        'Drooping speed-torque line of a limited current; Krishnan, Electric Motor Drives, 2001',
    ),
    Effect(
        'gear_backlash',
        'actuator',
        _gear_backlash,
        'Two plays of 0.85 and 1.15 of the gap in parallel, the soft flank of a worn gear; '
        'Krasnoselskii and Pokrovskii 1989; Nordin and Gutman 2002, Automatica 38(10)',
    ),
    Effect(
        'cogging',
        'actuator',
        _cogging,
        'Position ripple of first and second order of the tooth frequency; '
        'Gandhi, Oboe et al., harmonic drive kinematic error, 2002',
    ),
)
