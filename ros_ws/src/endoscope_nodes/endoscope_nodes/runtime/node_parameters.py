"""Parameters of all nodes: name, default, bounds, unit and meaning of each, in one place.

Nodes declare them, ``--help`` and the reference list them; nothing here needs ROS.
"""

import math
from dataclasses import dataclass
from typing import Any

from endoscope_core import choices
from endoscope_nodes import names
from endoscope_nodes.runtime.parameters import parameter
from endoscope_nodes.topics import RECORDED


# fmt: off
@dataclass(frozen=True)
class MotorDriverParameters:
    """Parameters of the motor driver."""

    device: str = parameter('',
        'what is driven; empty for what the rig file says', choices=('', *choices.MOTOR_DEVICES))


@dataclass(frozen=True)
class DynamixelParameters:
    """How the bus and its servos are set up; used where `device` is dynamixel."""

    port: str = parameter('/dev/ttyUSB0', 'serial port of the servos')
    baud: int = parameter(1_000_000, 'speed that the servos are set to', 'baud', 9600)
    servo_ids: tuple[int, ...] = parameter((1, 2),
        'ids of the servos of motor_x and motor_y', low=0, high=252)
    servo_directions: tuple[int, ...] = parameter((1, 1),
        '-1 where the shaft is positive in the negative sense of its servo', low=-1, high=1)
    servo_zeros: tuple[float, ...] = parameter((math.pi, math.pi),
        'angle of each servo at which its shaft is at 0', 'rad')
    current_limit: float = parameter(0.5,
        'current at which the firmware of the servos limits the tension of the wires',
        'A', 0.01, 3.2)
    bus_watchdog: float = parameter(0.1,
        'silence of the bus after which a servo stops by itself; in steps of 0.02', 's', 0.02, 2.54)
    bus_rate: float = parameter(1000.0,
        'cycles a second; 0 for as many as the bus carries', 'Hz', 0.0)
    fault_after: float = parameter(0.05,
        'time without a valid reading after which motion must be enabled again', 's', 0.005, 1.0)


@dataclass(frozen=True)
class LoadCellsParameters:
    """Parameters of the load cells."""

    device: str = parameter('',
        'what is read; empty for what the rig file says', choices=('', *choices.LOAD_CELL_DEVICES))
    port: str = parameter('', 'serial port of a modbus_rtu device, HOST:PORT of a modbus_tcp one')
    calibration_file: str = parameter('',
        'YAML file with registers, sensitivity, sign and zero of each cell of a real device')
    connected: bool = parameter(True,
        'false makes the simulated cells fall silent, as an unplugged cable does', dynamic=True)


@dataclass(frozen=True)
class EmTrackerParameters:
    """Parameters of the EM tracker."""

    device: str = parameter('',
        'what is read; empty for what the rig file says', choices=('', *choices.TRACKER_DEVICES))
    port: str = parameter('', 'serial port of an aurora')
    tool: int = parameter(1,
        'which of the sensors that are plugged in, in the order of their ports', low=1, high=32)
    latency: float = parameter(0.0,
        'time from measuring to having a frame, taken off its stamp', 's', 0.0, 0.5)
    sensor_roll: float = parameter(0.0,
        "angle about the instrument's axis from its x axis to the sensor's, as it is mounted",
        'rad', -math.pi, math.pi)
    registration_file: str = parameter('',
        'where the pose of the straight instrument is kept; empty to forget it')
    in_volume: bool = parameter(True,
        'false makes the simulated tracker lose its sensor, which then is silent', dynamic=True)


FOLLOWED = (
    names.SLAVE_COMMAND,
    names.CALIBRATION_COMMAND,
    names.CORRECTION,
    names.MOTOR_COMMAND,
    names.SLAVE_MEASURED,
    names.MOTOR_MEASURED,
    names.WIRES_MEASURED,
)
"""Streams that the simulation clock can wait for."""


FOR_SESSION = 'for_session'


def _for_session() -> Any:
    return parameter(
        False,
        'true: the parameters that are set with it fall back when the motion session ends, or the '
        'next one where none is open; false: they fall back now',
        dynamic=True,
    )


# fmt: off
@dataclass(frozen=True)
class BeatParameters:
    """Parameters of the first node of a process, for all of them."""

    tick_rate: int = parameter(1000,
        'beats of this process, or of /clock where it has the simulation clock; a divisor of 1000',
        'Hz', 10, 1000)
    rig_file: str = parameter('',
        'rig.yaml with gear, limits, time-outs and devices; what it does not say is as shipped',
        file=True)
    plant_file: str = parameter('',
        'plant.yaml of the simulated slave and its sensors; empty for that of the rig file',
        file=True)
    seed: int = parameter(-1,
        'seed of the simulated sensor noise; -1 for that of the rig file', low=-1)


@dataclass(frozen=True)
class RealTimeParameters:
    """Parameters of the first node of a process, for all of it."""

    realtime_priority: int = parameter(-1,
        'SCHED_FIFO priority of this process, which is locked into memory; 0 for none; -1 for 40 '
        'in real time where the limits rtprio and memlock of this user grant it', low=-1, high=99)
    cores: tuple[int, ...] = parameter((),
        'processor cores for this process, for example [2, 3]; by default all', low=0)


@dataclass(frozen=True)
class CalibrationParameters:
    """Parameters of the calibration."""

    weights: str = parameter('',
        'weights of the CNN as `endoscope train` writes them; empty for those that come with the '
        'project')
    motion: str = parameter(choices.SINUSOID,
        "motion by which the tube is judged: the first paper's sinusoid of 9 s, or one of 3 s",
        choices=choices.CALIBRATION_MOTIONS)
    identify_plant: bool = parameter(True,
        'whether to identify the plant of each joint from the tensions too: it shows how far the '
        'tube lets the tip be bent, which master and compensator keep to, and the physical modes '
        'of the compensator can be selected by it; half a second of computing')
    return_speed: float = parameter(1.0, 'largest speed on the way to zero', 'rad/s', 0.01, 10.0)
    rest: float = parameter(0.5, 'rest at zero before the motion', 's', 0.0, 60.0)


@dataclass(frozen=True)
class CompensatorParameters:
    """Parameters of the compensator."""

    mode: str = parameter('bouc_wen',
        'feed-forward model in force once its parameters are known',
        choices=choices.MODES, dynamic=True)
    selected_by: str = parameter(choices.BY_CLASS,
        'what of a calibration selects the parameters: the hysteresis class, the backlash size in '
        'the updated table, or (physical modes) the plant that it identified',
        choices=choices.SELECTIONS, dynamic=True)
    table: str = parameter('',
        'updated table as `endoscope identify --table` extends it; empty for one made of the class '
        'parameters')
    parameter_sets: str = parameter('',
        'file with a parameter set for each class, as `endoscope fit classes` writes it; empty for '
        'the one that comes with the project')
    lead: float = parameter(0.06,
        "time by which the desired angle is foreseen: the servo's own lag", 's', 0.0, 0.5)
    for_session: bool = _for_session()


@dataclass(frozen=True)
class ControllerParameters:
    """Parameters of the controller."""

    active: bool = parameter(True,
        'whether to learn and correct while the tracker is fresh', dynamic=True)
    tracker_timeout: float = parameter(0.15,
        'silence of the tracker after which the correction fades out', 's', 0.03, 5.0)
    fade_time: float = parameter(1.0,
        'time from no correction to the whole and back', 's', 0.05, 30.0)
    for_session: bool = _for_session()


@dataclass(frozen=True)
class MasterParameters:
    """Parameters of the master."""

    source: str = parameter('none',
        'where commands come from; setting it restarts a motion or file',
        choices=choices.SOURCES, dynamic=True)
    motion: str = parameter('periodic',
        'motion that is played', choices=choices.PLAYED_MOTIONS, dynamic=True)
    joints: tuple[str, ...] = parameter(names.JOINTS,
        'joints that the motion moves', choices=names.JOINTS, dynamic=True)
    command_file: str = parameter('',
        'CSV file that is played, columns time [s], bend_x and bend_y [rad]', dynamic=True)
    hold_to_play: bool = parameter(False,
        'whether a motion or file goes on only while the clutch is held, which another program '
        'then publishes', dynamic=True)
    scale: float = parameter(1.0,
        'slave motion for one radian of handle motion', low=0.01, high=10.0, dynamic=True)
    approach_speed: float = parameter(1.0,
        'largest speed on the way to the first angle of a motion', 'rad/s', 0.01, 10.0)
    for_session: bool = _for_session()


@dataclass(frozen=True)
class WatchParameters:
    """Parameters of the watch."""

    active: bool = parameter(False,
        'whether the rig is compared with its plant while it moves; off, it subscribes to nothing')
    plant: str = parameter('', 'plant.yaml that describes the rig; empty for that of the rig file')


@dataclass(frozen=True)
class TipForceParameters:
    """Parameters of the force at the tip."""

    active: bool = parameter(True,
        'whether the force at the tip is worked out; off, the node subscribes to nothing')


@dataclass(frozen=True)
class RecorderParameters:
    """Parameters of the recorder."""

    bag: str = parameter('',
        'folder or .mcap file to write; empty for bags/recording-DATE-TIME', dynamic=True)
    topics: tuple[str, ...] = parameter(RECORDED,
        'topics to record, relative ones in the namespace of the node')
    autostart: bool = parameter(True,
        'record from the start where a bag is named, instead of on recorder/start')
    keep: float = parameter(20.0,
        'what came last is kept in memory for so long, for the bag of a fault or a mark, and for '
        'at least 60 s where the watch is active; 0 for none of these', 's', 0.0, 600.0)
    keep_room: int = parameter(60, 'memory for that; 10^6 bytes', 'MB', 1, 4000)
    keep_bags: int = parameter(50,
        'bags of faults and marks in a folder, beyond which no more are written; none is deleted',
        low=1)
    drain_period: float = parameter(0.002, 'how often the queues are emptied', 's', 0.0005, 0.1)


@dataclass(frozen=True)
class ReplayParameters:
    """Parameters of the replay."""

    bag: str = parameter('', 'rosbag2 folder or .mcap file to replay')
    speed: float = parameter(1.0, 'recorded seconds in a real one', low=0.01, high=100.0)
    topics: tuple[str, ...] = parameter(('',), 'full names to publish; an empty one for all')
    clock: bool = parameter(True, 'publish the time of the recording on /clock')
    delay: float = parameter(1.0, 'time from finding all readers to the first message', 's', 0.0)
    beside_live_nodes: bool = parameter(False,
        'replay even where other nodes publish the same topics')


@dataclass(frozen=True)
class SimulationClockParameters:
    """Parameters of the simulation clock."""

    wait_for: tuple[str, ...] = parameter((names.MOTOR_MEASURED, names.WIRES_MEASURED),
        'topics that the clock waits for at each tick', choices=FOLLOWED)
    start: float = parameter(1.0, 'simulated time of the first tick', 's', 0.001)
    duration: float = parameter(0.0,
        'how long to run when started as a process of its own; 0 for ever', 's', 0.0)
    speed: float = parameter(0.0,
        'simulated seconds in a real one; 0 for as fast as possible', low=0.0, high=100.0)
    tracker_rate: float = parameter(40.0,
        'rate of slave/measured_js, to know in which ticks to expect it', 'Hz', 0.1, 1000.0)
    timeout: float = parameter(10.0, 'real time after which a missing answer is an error', 's', 0.1)
    grace: float = parameter(0.05,
        'real time after which a stream that is not waited for is taken as ended', 's', 0.001)
# fmt: on


OF_PROCESS = (BeatParameters, RealTimeParameters)
"""Of the first node of a process, for all of it."""

OF_NODE: dict[str, tuple[type, ...]] = {
    'motor_driver': (MotorDriverParameters, DynamixelParameters),
    'load_cells': (LoadCellsParameters,),
    'em_tracker': (EmTrackerParameters,),
    'supervisor': (),
    'compensator': (CompensatorParameters,),
    'controller': (ControllerParameters,),
    'calibration': (CalibrationParameters,),
    names.MASTER_NODE: (MasterParameters,),
    'instrument_model': (),
    'watch': (WatchParameters,),
    'tip_force': (TipForceParameters,),
    'recorder': (RecorderParameters,),
    'replay': (ReplayParameters,),
    names.CLOCK_NODE: (SimulationClockParameters,),
}
"""What each node declares."""
