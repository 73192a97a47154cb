"""Names of joints, motors, wires, topics and services, as other people's programs rely on them."""

from endoscope_core.names import JOINTS, MOTOR_MEASURED, MOTORS, SLAVE_COMMAND, WIRES  # noqa: F401

# Node names of the master and of the simulation clock, by which their parameters, permissions and
# diagnostics go. All other nodes are named as their modules.
MASTER_NODE = 'master'
CLOCK_NODE = 'simulation_clock'

MASTER_MEASURED = 'master/measured_js'
MASTER_CLUTCH = 'master/clutch'
SLAVE_VELOCITY = 'slave/servo_jv'
TIP_VELOCITY = 'slave/servo_cv'
SLAVE_MEASURED = 'slave/measured_js'
TIP_FORCE = 'slave/body/measured_cf'
TIP_FORCE_BOUNDS = 'tip_force/bounds'
CALIBRATION_COMMAND = 'calibration/servo_jp'
CALIBRATION_RESULT = 'calibration/result'
CALIBRATION_FEEDBACK = 'calibration/feedback'
CALIBRATION_NUMBERS = 'calibration/numbers'
CORRECTION = 'controller/correction_js'
COMPENSATOR_STATE = 'compensator/state'
COMPENSATOR_PLANT = 'compensator/plant'
COMPENSATOR_ADOPT = 'compensator/adopt'
MOTOR_COMMAND = 'motor/servo_jp'
MOTOR_SETPOINT = 'motor/setpoint_js'
WIRES_MEASURED = 'wires/measured_js'
TRACKER_POSE = 'tracker/measured_cp'
OPERATING_STATE = 'slave/operating_state'
MOTION_SESSION = 'slave/motion_session'
STATE_COMMAND = 'slave/state_command'
CONSOLE_LOG = 'console/log'
SIMULATED_WIRES = 'simulation/wires'
SIMULATED_BENDING = 'simulation/bending'
RECORDER_MARK = 'recorder/mark'
RIG_KIND = 'rig/kind'
ROBOT_DESCRIPTION = 'robot_description'
ROBOT_DESCRIPTION_OF_ALL = '/robot_description'
JOINT_STATES = 'joint_states'
TRANSFORMS = '/tf'
DIAGNOSTICS = '/diagnostics'
CLOCK = '/clock'

SLAVE_HOME = 'slave/home'
SLAVE_STOP = 'slave/stop'
CALIBRATION_RUN = 'calibration/run'
RECORDER_START = 'recorder/start'
RECORDER_STOP = 'recorder/stop'
WATCH_RESTART = 'watch/restart'
LOAD_CELLS_TARE = 'load_cells/tare'
REGISTER_STRAIGHT = 'em_tracker/register_straight'
MOTOR_REBOOT = 'motor/reboot'

# What stands on `tip_force/bounds`.
BOUNDS = ('force_x', 'force_y', 'low_x', 'low_y', 'high_x', 'high_y', 'seen')

# What `simulation_clock: lock-step` says on /diagnostics: simulated seconds in a real one.
FACTOR = 'real-time factor'
# What `supervisor: operating state` says there of a refused command: why, by a code of
# :class:`endoscope_core.safety.Answer` and in words, and when; and which streams never came.
REFUSAL, REFUSAL_CODE, REFUSED_NS = 'last refusal', 'refusal code', 'refused at [ns]'
AWAITED = 'awaited'
# And by what it runs: simulated or real time, gear, largest bending, its speed, and tension.
TIME, GEAR, REACH, SPEED, CEILING = (
    'time',
    'gear',
    'joint reach [rad]',
    'joint speed [rad/s]',
    'tension ceiling [N]',
)
# What `recorder: events` says there: how many marks it has heard, and its last bag of an event.
MARKS, LAST_EVENT = 'marks', 'last bag'
# What `recorder: recording` says there while it records: where, and whether nobody asked for it.
BAG = 'bag'
# What `watch: rig` says there first, until it can judge.
LEARNING = 'learning'
# What `master: commands` says there of a motion that it plays.
FINISHED = 'finished'
