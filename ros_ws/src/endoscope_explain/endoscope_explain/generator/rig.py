"""The concealed rig: every number of its two bending joints, as one numba-readable record each."""

import numpy as np
import numpy.typing as npt

JOINTS = ('bend_x', 'bend_y')
NOMINAL = {
    'pretension': 5.0,
    'wire_stiffness': 2000.0,
    'joint_radius': 0.0025,
    'pulley_radius': 0.005,
    'capstan_exponent': 0.9,
    'presliding_distance': 1.0e-4,
    'joint_stiffness': 0.003,
    'joint_damping': 3.0e-4,
    'joint_friction': 0.004,
    'joint_presliding': 0.02,
    'motor_bandwidth': 60.0,
    'motor_damping_ratio': 0.9,
}
# A person measures lengths with a caliper; everything else is known to some ten per cent.
WELL_KNOWN = ('joint_radius', 'pulley_radius')

# Every field is a float64 and zero means "this rig does not have it".
CONCEALED = (
    # actuator
    'transport_delay',
    'servo_lag',
    'command_slew',
    'speed_limit',
    'torque_limit',
    'gear_gap',
    'cogging_amplitude',
    'cogging_periods',
    'cogging_phase',
    'cogging_second',
    # wires
    'dead_zone',
    'missing_length',
    'loss',
    'loss_time',
    'toe_exponent',
    'creep_compliance_1',
    'creep_time_1',
    'creep_compliance_2',
    'creep_time_2',
    'softening',
    'softening_time',
    'crimp_slip',
    'crimp_time_1',
    'crimp_time_2',
    'crimp_time_3',
    # sheath
    'stribeck_rise',
    'stribeck_speed',
    'viscous',
    'viscous_power',
    'exponent_jump',
    'jump_time',
    'jump_width',
    'pull_release',
    'run_in_drop',
    'run_in_distance',
    'segments',
    'lumped_share',
    'sheath_power',
    'sheath_slip_elements',
    'ageing',
    'ageing_time',
    'ageing_distance',
    'ripple',
    'ripple_length',
    'ripple_phase',
    'wrap_own',
    'wrap_other',
    'tension_presliding',
    # joint
    'joint_power',
    'joint_slip_elements',
    'flank_gap',
    'output_gap',
    'stop_angle',
    'stop_stiffness',
    'stop_loss',
    'contact_angle',
    'contact_side',
    'contact_stiffness',
    'contact_power',
    'contact_loss',
    'gravity_moment',
    'gravity_phase',
    'load_moment',
    'load_time',
    'load_ramp',
    'inertia',
    'coupling',
    'coupling_square',
    'breathing_moment',
    'breathing_frequency',
    'breathing_phase',
    'bump_moment',
    'bump_angle',
    'bump_width',
    'periodic_moment',
    'periodic_number',
    'periodic_phase',
    'stiffness_square',
    'stiffness_cube',
    'friction_of_angle',
    'relaxing_stiffness',
    'relaxing_time',
)
RIG_TYPE = np.dtype([(name, np.float64) for name in (*NOMINAL, *CONCEALED)])


def nominal_rig() -> npt.NDArray[np.void]:
    """Rig of two joints at the nominal parameters, nothing concealed; shape (2,), `RIG_TYPE`."""
    rig = np.zeros(len(JOINTS), dtype=RIG_TYPE)
    for name, value in NOMINAL.items():
        rig[name] = value
    for name in ('sheath_power', 'joint_power', 'segments'):
        rig[name] = 1.0
    return rig


def mistune(rig: npt.NDArray[np.void], rng: np.random.Generator, spread: float) -> None:
    """Put every parameter that is not a known length off by up to `spread` (relative), in place."""
    for joint in range(rig.size):
        for name in NOMINAL:
            if name not in WELL_KNOWN:
                rig[name][joint] *= 1.0 + rng.uniform(-spread, spread)
