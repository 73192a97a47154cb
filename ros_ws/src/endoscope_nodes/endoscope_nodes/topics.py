"""The interface: every topic of the graph, in one place.

Nodes, recorder, help and reference pages take from here; nothing here needs ROS.

Sensors are offered reliable with a deep queue, so that a recorder can ask for everything, and
asked for best effort, so that a slow reader never holds a writer up.  Queues are deep because a
desktop kernel stalls for 5 to 15 ms now and then, which is 15 samples at 1 kHz.  A command is only
worth something while it is the newest: depth 1, and its reader checks its age.
"""

from dataclasses import dataclass

from endoscope_nodes import names


@dataclass(frozen=True)
class Qos:
    """Quality of service, as far as the interface uses it."""

    depth: int  # messages that the queue keeps, the newest ones
    reliable: bool = True  # what is lost is sent again; best effort otherwise
    latched: bool = False  # a reader that comes late is given the last message (transient local)

    def __str__(self) -> str:
        reliability = 'reliable' if self.reliable else 'best effort'
        return ', '.join((reliability, *['transient local'] * self.latched, str(self.depth)))


SENSOR_OFFERED = Qos(100)
SENSOR_ASKED = Qos(50, reliable=False)
RECORDER_ASKED = Qos(2000)
COMMAND = Qos(1)
RESULT = Qos(1, latched=True)
EVENT = Qos(10)
LOCK_STEP = Qos(100)


@dataclass(frozen=True)
class GraphTopic:
    """A topic of the interface."""

    name: str  # relative to the namespace of the graph, ``/endoscope`` by default, or absolute
    type: str  # for example ``'sensor_msgs/msg/JointState'``
    offered: Qos | None  # None where the sender is not a node of this project
    asked: Qos
    said_by: tuple[str, ...]  # nodes
    # Nodes; the recorder hears whatever is `recorded`, the simulation clock waits for the streams.
    heard_by: tuple[str, ...]
    rate: str  # in words, with its unit
    content: str  # what it says, each figure with its unit
    recorded: bool = True  # unless the recorder is set otherwise
    one_sender: bool = False  # whoever else speaks here while the slave is enabled is a fault


_JOINT_STATE = 'sensor_msgs/msg/JointState'
_TEXT = 'std_msgs/msg/String'
_DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
_STREAM = '1 kHz'
_LATCHED_STATE = 'on change, latched'
_MOVERS = ('master', 'compensator', 'controller')

# Offered and asked.
_SENSOR = SENSOR_OFFERED, SENSOR_ASKED
_COMMANDS, _RESULTS, _EVENTS, _LOCK_STEPS = ((q, q) for q in (COMMAND, RESULT, EVENT, LOCK_STEP))

# fmt: off
TOPICS = (
    GraphTopic(names.MASTER_MEASURED, _JOINT_STATE, None, SENSOR_ASKED, (), ('master',),
          "1 kHz or the handle's own",
          '`position` of the handle in rad, `bend_x` and `bend_y`', one_sender=True),
    GraphTopic(names.MASTER_CLUTCH, 'sensor_msgs/msg/Joy', *_EVENTS, ('master',),
          ('master', 'compensator'), 'on change and 10 Hz',
          '`buttons[0]` = 1: follow the handle, or go on with a motion that waits for it '
          "(`hold_to_play`); the master's own while it plays any other motion", one_sender=True),
    GraphTopic(names.SLAVE_COMMAND, _JOINT_STATE, *_COMMANDS, ('master',), ('compensator',
          'controller'),
          _STREAM,
          'desired bending: `position` in rad and `velocity` in rad/s of `bend_x` and `bend_y`, '
          "`header.frame_id` the motion session; the master's unless its source is `none` and "
          'nobody commands velocities', one_sender=True),
    GraphTopic(names.SLAVE_VELOCITY, _JOINT_STATE, None, COMMAND, (), ('master',),
          'more than 10 Hz',
          'desired velocity of bending: `velocity` in rad/s of `bend_x` and `bend_y`, '
          '`header.frame_id` the motion session; obeyed while the clutch is held and '
          '`master.source` is `none`, zero after 150 ms of silence', one_sender=True),
    GraphTopic(names.TIP_VELOCITY, 'geometry_msgs/msg/TwistStamped', None, COMMAND, (),
          ('master',), 'more than 10 Hz',
          "instead of `slave/servo_jv`, velocity of the tip in the tip's frame: `angular.x` and "
          '`angular.y` in rad/s or, where both are zero, `linear.x` and `linear.y` in m/s; the '
          'rest is ignored and reported; `header.frame_id` the motion session', one_sender=True),
    GraphTopic(names.SLAVE_MEASURED, _JOINT_STATE, *_SENSOR, ('em_tracker',),
          (*_MOVERS, 'calibration', 'instrument_model', 'watch', 'tip_force'), '40 Hz',
          'bending by the EM tracker: `position` in rad of `bend_x` and `bend_y`', one_sender=True),
    GraphTopic(names.MOTOR_COMMAND, _JOINT_STATE, *_COMMANDS, ('compensator',), ('motor_driver',),
          _STREAM, 'command to the shafts after compensation: `position` in rad of `motor_x` and '
          '`motor_y`, `header.frame_id` the motion session', one_sender=True),
    GraphTopic(names.MOTOR_SETPOINT, _JOINT_STATE, *_SENSOR, ('motor_driver',), ('watch',),
          'on change, 1 kHz in motion, and 20 Hz',
          'what the motor driver made of all commands: `position` in rad to which the shafts '
          '`motor_x` and `motor_y` are sent from the stamp on', one_sender=True),
    GraphTopic(names.MOTOR_MEASURED, _JOINT_STATE, *_SENSOR, ('motor_driver',),
          (*_MOVERS, 'calibration', 'supervisor', 'watch', 'tip_force', 'load_cells'),
          '1 kHz simulated, as the bus carries on hardware',
          '`position` in rad, `velocity` in rad/s and `effort` in N m of the shafts `motor_x` and '
          '`motor_y`', one_sender=True),
    GraphTopic(names.WIRES_MEASURED, _JOINT_STATE, *_SENSOR, ('load_cells',),
          ('calibration', 'supervisor', 'watch', 'tip_force'),
          '1 kHz simulated, as the transmitter is read on hardware',
          '`effort`: tension in N of `wire_x_pos`, `wire_x_neg`, `wire_y_pos` and `wire_y_neg`',
          one_sender=True),
    GraphTopic(names.TIP_FORCE, 'geometry_msgs/msg/WrenchStamped', *_SENSOR, ('tip_force',), (),
          '40 Hz, 0.1 s late, where it is known',
          "force on the tip across its axis in N, `force.x` and `force.y` in the tip's frame, "
          'positive where it pushes towards a positive angle; `force.z`, along the axis, cannot be '
          'seen and is NaN, and torques are taken for zero. Bounds are on `tip_force/bounds`'),
    GraphTopic(names.TIP_FORCE_BOUNDS, _JOINT_STATE, *_SENSOR, ('tip_force',), ('compensator',),
          '40 Hz, 0.1 s late, where it is known',
          'the same with bounds, for the guard of the compensator: `effort` in N of `force_x` and '
          '`force_y`, `low_x` to `high_y` the smallest and the largest that friction leaves open, '
          'and `seen` 1 where something touches the tip, or 0; NaN for a joint that the plant does '
          'not have', one_sender=True),
    GraphTopic(names.TRACKER_POSE, 'geometry_msgs/msg/PoseStamped', *_SENSOR, ('em_tracker',), (),
          '40 Hz', "pose of the tip in the frame of the instrument's base: m, and a quaternion"),
    GraphTopic(names.CALIBRATION_COMMAND, _JOINT_STATE, *_COMMANDS, ('calibration',), _MOVERS,
          '1 kHz while it calibrates or goes home',
          '`position` in rad and `velocity` in rad/s of the shafts, divided by the gear; goes '
          'before the master and passes uncompensated', recorded=False, one_sender=True),
    GraphTopic(names.CALIBRATION_RESULT, _DIAGNOSTICS, *_RESULTS, ('calibration',), _MOVERS,
          'once a calibration, latched',
          'status `calibration: hysteresis class`: `class_deg`, `probability`, '
          '`probability_40_deg` to `probability_100_deg`, `backlash_size` in rad, '
          '`backlash_size_deg`, `backlash_size_from` `tracker`, `cnn`, or `plant` where the '
          'classifier knows no such tensions and the plant explains them (with what wires have '
          'lost in N as `pretension_lost.bend_x` and so on), `regressed_size` by the CNN from '
          'tensions alone in rad and its 90 % interval `regressed_size_low` to '
          '`regressed_size_high`, `duration` in s, what the zero of each load cell is off by as '
          '`zero_error.wire_x_pos` and so on in N, and unless `identify_plant` is false the plant '
          'of each joint as `bend_x.capstan_exponent` and so on, and how far the tube lets it '
          'bend as `reach.bend_x.low` and `reach.bend_x.high` in rad. After an abort the level is '
          'ERROR, with `reason` and `step`; for tensions that neither explains it is ERROR, with '
          '`reason` and `class_deg` `none`, and nothing is compensated', one_sender=True),
    GraphTopic(names.CALIBRATION_FEEDBACK, _DIAGNOSTICS, *_RESULTS, ('calibration',),
          ('tip_force',),
          'on change and 10 Hz while it calibrates or goes home, latched',
          'status `calibration: order`, for programs: `order` is `calibrate` or `home`, `id` the '
          'time in ns at which it was given, or just after it where another has that, `state` is '
          '`executing`, `succeeded`, `aborted` or `rejected`, and `waiting` before the first '
          'order; `phase` is `returning`, `resting`, `moving` or `judging`, `progress` goes from '
          '0 to 1, and `code` says why it was aborted or rejected: `busy`, `beyond_reach`, '
          '`no_session`, `session_ended`, `tension_ceiling`, `stream_silent`, `tension_gap`, '
          '`unknown_tube`, `not_judged` or `not_reached`; the message is the same in words'),
    GraphTopic(names.CALIBRATION_NUMBERS, _JOINT_STATE, *_RESULTS, ('calibration',), (),
          'once a calibration, latched',
          'the figures of `calibration/result` as numbers, for programs that plot: `name` is the '
          'key, `position` the value in SI; `class` in rad, `success` 1 or 0'),
    GraphTopic(names.CORRECTION, _JOINT_STATE, *_COMMANDS, ('controller',), ('compensator',),
          '1 kHz while commands come',
          'correction by feedback: `position` in rad of `bend_x` and `bend_y`, added to the '
          'command of the shafts divided by the gear', recorded=False, one_sender=True),
    GraphTopic(names.COMPENSATOR_STATE, _DIAGNOSTICS, *_RESULTS, ('compensator',), (),
          _LATCHED_STATE,
          'status `compensator: model`: `mode` in force, `wanted_mode`, `selected_by`, '
          "`class_deg`, `lead` in s, `gear`, and the mode's parameters of each joint as "
          '`bend_x.…`', one_sender=True),
    GraphTopic(names.COMPENSATOR_PLANT, _DIAGNOSTICS, *_RESULTS, ('compensator',),
          ('master', 'watch', 'tip_force'),
          _LATCHED_STATE,
          'status `compensator: adopted plant`: `hash`, the first digits of the SHA-256 of the '
          'plant file in force, and of the one before as `before`, `left_out` of its inverse, how '
          'far the tip may be bent as `reach.bend_x.low` and so on in rad, and the file itself as '
          '`plant`, all but the reach empty where none has been adopted; status `compensator: '
          'adoption`, what became of the last request: `id`, `state` `executing`, `succeeded` or '
          '`rejected`, and `code`: `not_a_plant`, `other_joints`, `not_invertible`, '
          '`beyond_range`, `moving`, `busy`, `not_measured`, `no_session`, `other_session`, '
          '`other_sender`, `nothing_to_undo` or `withdrawn`; the message is the same in words',
          one_sender=True),
    GraphTopic(names.COMPENSATOR_ADOPT, _DIAGNOSTICS, *_EVENTS, (), ('compensator',),
          'when somebody asks',
          'status `adopt`: `id` of the request and the file as `plant`, empty for the plant '
          'before; `header.frame_id` names the motion session'),
    GraphTopic(names.OPERATING_STATE, _TEXT, *_RESULTS, ('supervisor',), ('motor_driver',),
          'on change and 20 Hz, latched',
          '`DISABLED`, `ENABLED`, `PAUSED` or `FAULT`', one_sender=True),
    GraphTopic(names.MOTION_SESSION, 'std_msgs/msg/Header', *_EVENTS, ('supervisor',),
          (*_MOVERS, 'calibration', 'motor_driver'), 'on change and 20 Hz',
          '`frame_id` names the motion session that the last `enable` opened; empty for none',
          one_sender=True),
    GraphTopic(names.STATE_COMMAND, _TEXT, None, EVENT, (), ('supervisor', 'calibration'),
          'when somebody asks', '`enable`, `disable`, `pause`, `resume` or `home`'),
    GraphTopic(names.CONSOLE_LOG, _DIAGNOSTICS, *_EVENTS, (), (), 'when somebody asks at a page',
          'what was asked for at a page of `endoscope console`, and what became of it: status '
          '`console_web: order` with `operator`, `address`, `order`, `answer` and `why`'),
    GraphTopic(names.RECORDER_MARK, _TEXT, *_EVENTS, ('watch',), ('recorder',),
          'when somebody asks',
          'an operator, or the watch, marks this moment, in words or with an empty text: the '
          'recorder writes what came before and the 2 s after as a bag'),
    GraphTopic(names.SIMULATED_WIRES, _JOINT_STATE, *_LOCK_STEPS, ('motor_driver',),
          ('load_cells',),
          _STREAM,
          'what the simulated slave shows its simulated load cells, without noise: `effort` in N',
          recorded=False),
    GraphTopic(names.SIMULATED_BENDING, _JOINT_STATE, *_LOCK_STEPS, ('motor_driver',),
          ('em_tracker',),
          _STREAM,
          'what the simulated slave shows its simulated tracker, without noise: `position` in rad',
          recorded=False),
    GraphTopic(names.RIG_KIND, _TEXT, *_RESULTS, ('motor_driver',), (),
          'once and on change, latched',
          'what the rig is, as YAML: `kind` `simulated`, `emulated` (servos that this project '
          'emulates) or `real`, `program` and its version, `rig_sha256` of its `rig.yaml`, and of '
          'a simulated one `plant` and `plant_sha256`; every recording has it'),
    GraphTopic(names.ROBOT_DESCRIPTION, _TEXT, *_RESULTS, ('instrument_model',), (),
          'once, latched',
          'the instrument as URDF for programs that draw robots: insertion tube, bending section '
          'as a chain of vertebrae, tip and wires, of cylinders and spheres alone'),
    GraphTopic(names.ROBOT_DESCRIPTION_OF_ALL, _TEXT, *_RESULTS, ('instrument_model',), (),
          'once, latched', 'the same where viewers look for it first'),
    GraphTopic(names.JOINT_STATES, _JOINT_STATE, *_SENSOR, ('instrument_model',), (), '20 Hz',
          'the measured bending as `position` in rad of every joint of `robot_description`, '
          '`vertebra_01_x` and so on'),
    GraphTopic(names.TRANSFORMS, 'tf2_msgs/msg/TFMessage', SENSOR_OFFERED, SENSOR_OFFERED,
          ('instrument_model',), (), '20 Hz',
          'where every link of `robot_description` is, from the base to the tip of the instrument'),
    GraphTopic(names.DIAGNOSTICS, _DIAGNOSTICS, *_EVENTS, ('every node',), ('supervisor',),
          '1 Hz, and at once when a node is in trouble',
          'health of every node, as `/endoscope/NODE: subcomponent`'),
    GraphTopic(names.CLOCK, 'rosgraph_msgs/msg/Clock', LOCK_STEP, SENSOR_ASKED,
          ('simulation_clock', 'replay'), ('every node',),
          'every simulated millisecond, in simulated time only',
          'the simulated time', recorded=False),
)
# fmt: on

BY_NAME = {topic.name: topic for topic in TOPICS}
RECORDED = tuple(topic.name for topic in TOPICS if topic.recorded)
