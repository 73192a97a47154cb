"""Concealed effects of wires and sheath."""

from endoscope_explain.generator.concealment import Comparable, Effect, Setting


def _wire_slack(s: Setting) -> Comparable:
    nominal_stretch = float(s.rig['pretension'][s.joint] / s.rig['wire_stiffness'][s.joint])
    if s.strength >= 0.5 and s.rng.random() < 0.5:
        s.put(missing_length=nominal_stretch + s.strength * s.within(2e-4, 8e-4))
    else:
        s.put(dead_zone=s.strength * s.within(3e-4, 1.0e-3))
    return {}


def _pretension_loss(s: Setting) -> Comparable:
    loss = s.strength * (s.within(1.0, 2.2) if s.duration > 20.0 else s.within(0.5, 1.2))
    time_constant = s.duration * s.within(1.5, 4.0)
    # Chosen so that the mean rate over the recording is the drawn loss over its length.
    ratio = s.duration / time_constant
    whole = loss / (1.0 - 2.718281828459045**-ratio)
    s.put(loss=whole, loss_time=time_constant)
    return {'rate_n_per_s': loss / s.duration}


def _stribeck_friction(s: Setting) -> Comparable:
    s.put(
        stribeck_rise=s.strength * s.within(0.35, 0.9),
        stribeck_speed=s.within(0.8e-3, 2.5e-3),
    )
    return {}


def _viscous_friction(s: Setting) -> Comparable:
    s.put(viscous=s.strength * s.within(80.0, 220.0), viscous_power=s.within(0.88, 1.0))
    return {}


def _wire_stiffening(s: Setting) -> Comparable:
    s.put(toe_exponent=s.strength * s.within(150.0, 450.0))
    return {}


def _wire_creep(s: Setting) -> Comparable:
    compliance = s.strength * s.within(0.3, 0.9) / float(s.rig['wire_stiffness'][s.joint])
    share = s.within(0.35, 0.65)
    s.put(
        creep_compliance_1=share * compliance,
        creep_time_1=s.within(0.3, 1.2),
        creep_compliance_2=(1.0 - share) * compliance,
        creep_time_2=s.within(3.0, 10.0),
    )
    return {}


def _configuration_change(s: Setting) -> Comparable:
    jump = s.within(0.35, 0.9) if s.rng.random() < 0.6 else -s.within(0.3, 0.55)
    moment = s.moment_in_motion()
    s.put(exponent_jump=s.strength * jump, jump_time=moment, jump_width=s.within(0.02, 0.12))
    return {'time_s': moment}


def _friction_asymmetry(s: Setting) -> Comparable:
    s.put(pull_release=s.strength * s.either_sign(0.2, 0.45))
    return {}


def _friction_run_in(s: Setting) -> Comparable:
    distance = s.within(0.008, 0.03) if s.duration > 20.0 else s.within(0.003, 0.01)
    s.put(run_in_drop=s.strength * s.within(0.3, 0.6), run_in_distance=distance)
    return {}


def _distributed_friction(s: Setting) -> Comparable:
    # A weak one moves only a part of the friction from the lumped sheath into the chain.
    s.put(segments=float(s.rng.integers(5, 11)), lumped_share=1.0 - s.strength)
    return {}


def _presliding_shape(s: Setting) -> Comparable:
    place = 'sheath' if s.rng.random() < 0.6 else 'joint'
    kind = s.rng.integers(3)
    if kind == 2 and s.strength >= 0.5:
        s.put(**{f'{place}_slip_elements': 1.0})
    else:
        power = s.within(0.3, 0.55) if kind == 0 else s.within(1.8, 3.0)
        s.put(**{f'{place}_power': power**s.strength})
    return {}


TRANSMISSION_EFFECTS = (
    Effect(
        'wire_slack',
        'transmission',
        _wire_slack,
        'Smooth dead zone about the pretension, or more missing length than pretension takes up; '
        'Agrawal, Peine, Yao 2010, IEEE Trans. Robotics 26(6)',
    ),
    Effect(
        'pretension_loss',
        'transmission',
        _pretension_loss,
        'Exponential stress relaxation to a lower plateau; Findley, Creep and Relaxation, 1976',
    ),
    Effect(
        'stribeck_friction',
        'transmission',
        _stribeck_friction,
        'Lorentzian curve with frictional lag; Hess and Soom 1990; Armstrong-Helouvry et al. 1994',
    ),
    Effect(
        'viscous_friction',
        'transmission',
        _viscous_friction,
        'Slightly shear-thinning drag (Carreau fluid) shared by both ends of the sheath; Bird 1987',
    ),
    Effect(
        'wire_stiffening',
        'transmission',
        _wire_stiffening,
        'Exponential law of Fung 1967, Am. J. Physiology 213(6)',
    ),
    Effect(
        'wire_creep',
        'transmission',
        _wire_creep,
        'Two Kelvin-Voigt elements in series with the wire; Findley, Creep and Relaxation, 1976',
    ),
    Effect(
        'configuration_change',
        'transmission',
        _configuration_change,
        'Jump of the wrap angle along a hyperbolic tangent; Kaneko et al. 1991',
    ),
    Effect(
        'friction_asymmetry',
        'transmission',
        _friction_asymmetry,
        'Exponent that follows the pre-sliding state from release to pull; Do et al. 2014',
    ),
    Effect(
        'friction_run_in',
        'transmission',
        _friction_run_in,
        'Hyperbolic fall with distance slid; Blau 2006, Tribology International 38(11)',
    ),
    Effect(
        'distributed_friction',
        'transmission',
        _distributed_friction,
        'Chain of segments with capstan friction at each, implicit; Kaneko et al. 1991; Palli 2012',
    ),
    Effect(
        'presliding_shape',
        'transmission',
        _presliding_shape,
        "Dahl's law with an exponent (Dahl 1976; Bliman 1992), or parallel slip elements "
        '(Iwan 1966; Al-Bender 2004)',
    ),
)
