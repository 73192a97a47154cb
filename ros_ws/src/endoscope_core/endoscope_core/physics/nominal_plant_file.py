"""A complete plant.yaml to begin with: every key, its nominal value, unit and meaning."""

from dataclasses import asdict
from typing import Any

from endoscope_core.physics.description import JointParameters, SensorParameters
from endoscope_core.physics.plant_file import JOINT_NAMES, REACH

MEANING = {
    'pretension': 'tension of each wire at the motor before the start',
    'pretension_profile': 'how the wires were tightened: 1 from the motor, 0 evenly, -1 to 1',
    'wire_stiffness': 'stiffness of a whole wire',
    'pulley_radius': 'radius at which the wires are wound at the motor',
    'joint_radius': 'radius at which the wires act on the joint',
    'capstan_exponent': 'friction times the bend of the whole sheath; what its shape changes',
    'joint_stiffness': 'elastic moment of the bending section',
    'joint_rest_angle': 'angle at which the bending section rests without wires',
    'joint_friction': 'Dahl friction of the joint',
    'joint_presliding': 'angle over which that friction builds up',
    'joint_presliding_spread': 'spread of three such angles, 0 for one',
    'joint_damping': 'viscous moment of the bending section',
    'motor_bandwidth': "natural frequency of the servo's position loop",
    'motor_damping_ratio': 'its damping ratio',
    'friction_profile': 'how friction is spread along the wire: cosine coefficients, [] evenly',
    'load_cell_noise': 'noise (rms) of the load cells',
    'load_cell_resolution': 'their step',
    'load_cell_rate': 'their rate, and that of the motors where a bag has none',
    'tracker_noise': 'noise (rms) of the bending angle from the tracker',
    'tracker_rate': 'its rate',
    'encoder_counts': "of the motor's encoder",
    'velocity_resolution': "step of the motor's velocity",
    'effort_noise': "noise (rms) of the motor's torque",
    'effort_resolution': 'its step',
}
"""Of each key of joints and sensors."""


def nominal_plant_text() -> str:
    """Return the nominal rig as a plant.yaml with comments, which `load_plant` reads."""
    lines = [
        '# The nominal plant, whole. Every key may be left out and has this value then.',
        'joints:',
    ]
    for name in JOINT_NAMES:
        lines += [f'  {name}:', *_lines(asdict(JointParameters()), 4)]
    lines += ['sensors:', *_lines(asdict(SensorParameters()), 2)]
    lines += [
        '# Physics beyond that: `endoscope effects` lists it, `endoscope effects ID` tells all.',
        '# effects:',
        '#   - {id: ID, joint: bend_x, parameters: {NAME: NUMBER}}',
        'effects: []',
    ]
    return '\n'.join(lines) + '\n'


def _lines(values: dict[str, Any], indent: int) -> list[str]:
    lines = []
    for key, value in values.items():
        unit = REACH[key][2]
        shown = list(value) if isinstance(value, tuple) else value
        text = f'{" " * indent}{key}: {shown}'
        lines.append(f'{text:40}  # {unit + "; " if unit else ""}{MEANING[key]}')
    return lines
