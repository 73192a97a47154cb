"""Columns of the arrays that go into the compiled physics of a joint, and that come out of it."""

OUT_MOTOR, OUT_MOTOR_SPEED, OUT_EFFORT, OUT_TENSION_A, OUT_TENSION_B, OUT_BENDING, OUT_JOINT = (
    range(7)
)
OUTPUTS = 7

IN_COMMAND, IN_OTHER_JOINT, IN_MOTOR, IN_PUSH_COMMAND, IN_PUSH_STRETCH, IN_PUSH_MOMENT = range(6)
INPUTS = 6
"""Columns of the input: command u, the other joint's angle, measured motor angle (NaN: let the
servo run), and latent pushes added to command (rad), wire stretch (m) and joint moment (N m)."""
