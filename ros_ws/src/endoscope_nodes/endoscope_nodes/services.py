"""Every service of the graph, in one place; nothing here needs ROS."""

from dataclasses import dataclass

from endoscope_nodes import names

TRIGGER = 'std_srvs/srv/Trigger'


@dataclass(frozen=True)
class Service:
    """A service of the graph; all are `std_srvs/srv/Trigger`: success, and a message in words."""

    name: str  # relative to the namespace of the graph
    served_by: str  # node
    purpose: str  # what it does and when it is refused
    device: str = ''  # without which it is not there; empty for none


# fmt: off
SERVICES = (
    Service(names.CALIBRATION_RUN, 'calibration',
            'begins a calibration, which needs an enabled slave; calibration/result says how it '
            'went'),
    Service(names.RECORDER_START, 'recorder',
            'begins a recording, and says where; refused while one is being made'),
    Service(names.RECORDER_STOP, 'recorder',
            'ends the recording, and says how many messages it has and how many were lost'),
    Service(names.WATCH_RESTART, 'watch',
            'forgets its alarms and what it has learnt of the rig, and learns anew; refused while '
            'it is off'),
    Service(names.LOAD_CELLS_TARE, 'load_cells',
            'takes the tension of the last second for zero; refused while shafts turn, noise or '
            'drift is too large or the wires are loaded, and by simulated cells'),
    Service(names.REGISTER_STRAIGHT, 'em_tracker',
            'takes the mean pose of the last second for that of the straight instrument; refused '
            'while it moves, and by the simulated tracker'),
    Service(names.MOTOR_REBOOT, 'motor_driver',
            'restarts servos that have shut down, without torque; refused while the slave is '
            'enabled', device='dynamixel'),
)
# fmt: on
"""Every service of the graph, beside those that ROS gives every node."""
