"""Physics that no entry of the catalogue expresses."""

from endoscope_explain.generator.concealment import Comparable, Effect, Setting


def _dwell_friction(s: Setting) -> Comparable:
    s.put(
        ageing=s.strength * s.within(0.25, 0.5),
        ageing_time=s.within(0.05, 0.2),
        ageing_distance=s.within(1e-4, 4e-4),
    )
    return {}


def _moment_bump(s: Setting) -> Comparable:
    s.put(
        bump_moment=s.strength * s.either_sign(0.008, 0.016),
        bump_angle=s.within(-0.4, 0.4),
        bump_width=s.within(0.06, 0.15),
    )
    return {}


def _sheath_ripple(s: Setting) -> Comparable:
    s.put(
        ripple=s.strength * s.within(0.35, 0.7),
        ripple_length=s.within(0.8e-3, 2.0e-3),
        ripple_phase=s.within(0.0, 6.28),
    )
    return {}


def _thermal_softening(s: Setting) -> Comparable:
    s.put(
        softening=s.strength * s.within(0.3, 0.55),
        softening_time=s.within(0.25, 0.7) * s.duration,
    )
    return {}


def _moment_ripple(s: Setting) -> Comparable:
    s.put(
        periodic_moment=s.strength * s.within(0.005, 0.01),
        periodic_number=s.within(10.0, 22.0),
        periodic_phase=s.within(0.0, 6.28),
    )
    return {}


def _tension_presliding(s: Setting) -> Comparable:
    s.put(tension_presliding=s.strength * s.within(1.8, 3.0), presliding_distance=3e-4)
    return {}


def _skewed_stiffness(s: Setting) -> Comparable:
    s.put(
        stiffness_square=s.strength * s.either_sign(0.008, 0.016),
        stiffness_cube=s.strength * s.within(0.008, 0.016),
    )
    return {}


def _crimp_slips(s: Setting) -> Comparable:
    first = s.moment_in_motion()
    span = s.duration - first
    s.put(
        crimp_slip=s.strength * s.within(2e-4, 5e-4),
        crimp_time_1=first,
        crimp_time_2=first + s.within(0.15, 0.4) * span,
        crimp_time_3=first + s.within(0.5, 0.8) * span,
    )
    return {}


def _bending_wrap(s: Setting) -> Comparable:
    s.put(wrap_own=s.strength * s.within(0.6, 1.3))
    return {}


def _other_joint_wrap(s: Setting) -> Comparable:
    s.put(wrap_other=s.strength * s.within(4.0, 8.0))
    return {}


def _relaxing_joint(s: Setting) -> Comparable:
    s.put(relaxing_stiffness=s.strength * s.within(0.006, 0.014), relaxing_time=s.within(0.4, 2.0))
    return {}


def _angle_friction(s: Setting) -> Comparable:
    s.put(friction_of_angle=s.strength * s.within(3.0, 7.0))
    return {}


def _motor_interference(s: Setting) -> Comparable:
    s.faults.motor_interference[s.joint] = s.strength * s.either_sign(0.8, 2.0)
    return {}


OUTSIDE_EFFECTS = (
    Effect(
        'dwell_friction',
        'transmission',
        _dwell_friction,
        'Ageing law: friction grows with the logarithm of time at rest; Ruina 1983; Dieterich 1979',
    ),
    Effect('moment_bump', 'joint', _moment_bump, 'Gaussian moment at one bending angle'),
    Effect(
        'sheath_ripple',
        'transmission',
        _sheath_ripple,
        'Friction periodic in the position of the wire, as over the coils of a spring sheath',
    ),
    Effect(
        'thermal_softening',
        'transmission',
        _thermal_softening,
        'Stiffness of a polymer wire relaxing exponentially as it warms; Ferry 1980',
    ),
    Effect('moment_ripple', 'joint', _moment_ripple, 'Moment periodic in the angle: vertebrae'),
    Effect(
        'tension_presliding',
        'transmission',
        _tension_presliding,
        'Pre-sliding distance a power of the tension; Mindlin and Deresiewicz 1953',
    ),
    Effect('skewed_stiffness', 'joint', _skewed_stiffness, 'Quadratic and cubic joint stiffness'),
    Effect('crimp_slips', 'transmission', _crimp_slips, 'Wire slips in its crimp, three times'),
    Effect(
        'bending_wrap',
        'transmission',
        _bending_wrap,
        'Wrap angle of the wire grows with the bending itself; Kato et al. 2016, IJCARS 11(6)',
    ),
    Effect(
        'other_joint_wrap',
        'transmission',
        _other_joint_wrap,
        'Wrap angle grows with the square of the other bending; Kato et al. 2016',
    ),
    Effect(
        'relaxing_joint',
        'joint',
        _relaxing_joint,
        'Standard linear solid of the bending rubber; Findley, Creep and Relaxation, 1976',
    ),
    Effect('angle_friction', 'joint', _angle_friction, 'Joint friction quadratic in the angle'),
    Effect(
        'motor_interference',
        'sensing',
        _motor_interference,
        "Field of the motor's current bends the tracker's reading; Franz et al. 2014",
    ),
)
