"""Names of signals as the report writes them."""

from endoscope_explain.recording.series import BENDING, MOTOR, WIRES

QUANTITY_TOPICS = {
    'shaft_position': MOTOR,
    'shaft_velocity': MOTOR,
    'shaft_effort': MOTOR,
    'tension': WIRES,
    'bending': BENDING,
}
"""Topic of each measured series of a `Recording`."""

QUANTITY_UNITS = {
    'shaft_position': 'rad',
    'shaft_velocity': 'rad/s',
    'shaft_effort': 'N m',
    'tension': 'N',
    'bending': 'rad',
}


def axis(joint: str) -> str:
    """Return the letter of a joint: `x` of `bend_x`."""
    return joint.rpartition('_')[2]


def wire_names(joint: str) -> tuple[str, str]:
    """Return the names of the positive and the negative wire of a joint."""
    return f'wire_{axis(joint)}_pos', f'wire_{axis(joint)}_neg'


def motor_name(joint: str) -> str:
    """Return the name of a joint's motor."""
    return f'motor_{axis(joint)}'


def signal_name(quantity: str, joint: str, wire: int = 0) -> str:
    """Return the name of one column of a series, for example `wires/measured_js:wire_x_pos`.

    The three quantities of the motor share a topic and are told apart by a suffix:
    `motor/measured_js:motor_x.position`.
    """
    topic = QUANTITY_TOPICS[quantity]
    if quantity == 'tension':
        return f'{topic}:{wire_names(joint)[wire]}'
    if quantity == 'bending':
        return f'{topic}:{joint}'
    return f'{topic}:{motor_name(joint)}.{quantity.removeprefix("shaft_")}'
