"""Names of a rig's parts and of the topics that messages of the core name."""

JOINTS = ('bend_x', 'bend_y')
MOTORS = ('motor_x', 'motor_y')
WIRES = ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg')

SLAVE_COMMAND = 'slave/servo_jp'
MOTOR_MEASURED = 'motor/measured_js'
