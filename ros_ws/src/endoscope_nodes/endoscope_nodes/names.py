"""Names of joints, motors, wires, topics and services, as other people's programs rely on them."""

JOINTS = ('bend_x', 'bend_y')
MOTORS = ('motor_x', 'motor_y')
WIRES = ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg')

MASTER_MEASURED = 'master/measured_js'
MASTER_CLUTCH = 'master/clutch'
SLAVE_COMMAND = 'slave/servo_jp'
SLAVE_MEASURED = 'slave/measured_js'
CALIBRATION_COMMAND = 'calibration/servo_jp'
CALIBRATION_RESULT = 'calibration/result'
CALIBRATION_FEEDBACK = 'calibration/feedback'
CALIBRATION_NUMBERS = 'calibration/numbers'
CORRECTION = 'controller/correction_js'
COMPENSATOR_STATE = 'compensator/state'
MOTOR_COMMAND = 'motor/servo_jp'
MOTOR_MEASURED = 'motor/measured_js'
WIRES_MEASURED = 'wires/measured_js'
TRACKER_POSE = 'tracker/measured_cp'
OPERATING_STATE = 'slave/operating_state'
MOTION_SESSION = 'slave/motion_session'
STATE_COMMAND = 'slave/state_command'
CONSOLE_LOG = 'console/log'
SIMULATED_WIRES = 'simulation/wires'
SIMULATED_BENDING = 'simulation/bending'
ROBOT_DESCRIPTION = 'robot_description'
ROBOT_DESCRIPTION_OF_ALL = '/robot_description'
JOINT_STATES = 'joint_states'
TRANSFORMS = '/tf'
DIAGNOSTICS = '/diagnostics'
CLOCK = '/clock'

CALIBRATION_RUN = 'calibration/run'
RECORDER_START = 'recorder/start'
RECORDER_STOP = 'recorder/stop'
LOAD_CELLS_TARE = 'load_cells/tare'
REGISTER_STRAIGHT = 'em_tracker/register_straight'
MOTOR_REBOOT = 'motor/reboot'

# What `calibration: procedure` says on /diagnostics where nothing is being done, and of a way home.
PROCEDURE_WAITING = 'waiting'
HOME_REACHED = 'home reached'
# What is said of a stream that has to be there before the slave may move, and was never heard.
NOT_RECEIVED = 'has not been received'
# What `conductor: lock-step` says on /diagnostics: simulated seconds in a real one.
FACTOR = 'real-time factor'
# What `calibration/feedback` says of an order, as the states of a ROS action's goal are called, and
# why one was rejected or aborted.
EXECUTING, SUCCEEDED, ABORTED, REJECTED = 'executing', 'succeeded', 'aborted', 'rejected'
BUSY, NO_SESSION, SESSION_ENDED = 'busy', 'no_session', 'session_ended'
TENSION_CEILING, STREAM_SILENT, TENSION_GAP = 'tension_ceiling', 'stream_silent', 'tension_gap'
UNKNOWN_TUBE, NOT_JUDGED, NOT_REACHED = 'unknown_tube', 'not_judged', 'not_reached'
# What `calibration/run` answers; the stamp tells this calibration's result from one before it.
CALIBRATION_BEGUN = f'begun at {{}} ns; {CALIBRATION_RESULT} will say how it went'
