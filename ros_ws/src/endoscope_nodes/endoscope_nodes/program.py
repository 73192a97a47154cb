"""The programs of the nodes: each can be stopped and asked for help before anything is loaded."""

import importlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from endoscope_nodes.stop_signals import end_when_asked

_ROS_ARGS = '--ros-args'
_END_OF_ROS_ARGS = '--'
_HELP = """\
usage: {name} [--ros-args [-p PARAMETER:=VALUE ...] [--params-file FILE ...]
       {blank} [-r __ns:=/NAMESPACE] [-r OLD:=NEW ...] [--log-level LEVEL]]

{purpose}

Parameters are listed in README.md; `ros2 param describe` tells those of a node that runs. What is
unknown, misspelt or out of range is refused.

SIGINT, SIGTERM and SIGHUP stop it. Exit status: 0, or 1 where a recording is incomplete or a replay
was refused, 2 for arguments or parameters that it does not start with, 128 + the signal's number
where it was stopped before it had started."""


@dataclass(frozen=True)
class Program:
    """One command of the package.

    Attributes
    ----------
    name
        That of the command, and of the node if it runs a single one.
    module
        Module of the package whose ``main()`` runs it.
    purpose
        One line for the help.
    """

    name: str
    module: str
    purpose: str

    def __call__(self, argv: Sequence[str] | None = None) -> int:
        """Run it.

        Parameters
        ----------
        argv
            The command line without the name of the program; ``sys.argv`` by default.

        Returns
        -------
        int
            Exit status; see the help.
        """
        end_when_asked(self.name)
        words = words_for_nobody(sys.argv[1:] if argv is None else argv)
        if words and words[0] in ('-h', '--help'):
            print(_HELP.format(name=self.name, blank=' ' * len(self.name), purpose=self.purpose))
            return 0
        if words:
            print(
                f"{self.name}: unknown argument '{words[0]}'; parameters go behind {_ROS_ARGS} "
                f'(see {self.name} --help)',
                file=sys.stderr,
            )
            return 2
        module = importlib.import_module(f'endoscope_nodes.{self.module}')
        return int(module.main())


def words_for_nobody(argv: Sequence[str]) -> list[str]:
    """Return the words of a command line that are not ROS arguments.

    Those stand between ``--ros-args`` and ``--`` or the end, as often as one likes; see
    https://design.ros2.org/articles/ros_command_line_arguments.html.
    """
    words = []
    for_ros = False
    for word in argv:
        if for_ros:
            for_ros = word != _END_OF_ROS_ARGS
        elif word == _ROS_ARGS:
            for_ros = True
        else:
            words.append(word)
    return words


console = Program('console', 'console_node', 'Turns the motion of the handle into commands.')
motor_driver = Program('motor_driver', 'motor_driver_node', 'Drives the motors of the slave.')
load_cells = Program('load_cells', 'load_cells_node', 'Measures the tensions of the wires.')
em_tracker = Program('em_tracker', 'em_tracker_node', 'Measures where the tip is.')
calibration = Program('calibration', 'calibration_node', 'Calibrates the model of hysteresis.')
compensator = Program('compensator', 'compensator_node', 'Compensates hysteresis.')
controller = Program('controller', 'controller_node', 'Corrects the tip by what is measured.')
supervisor = Program('supervisor', 'supervisor_node', 'Decides whether the slave may move.')
recorder = Program('recorder', 'recorder_node', 'Records topics into a bag.')
replay = Program('replay', 'replay_node', "Publishes a bag's topics again.")
conductor = Program('conductor', 'conductor_node', 'Makes simulated time for all nodes.')
graph = Program('graph', 'graph', 'Runs all nodes in one process.')

NODES = tuple(
    program.name
    for program in (
        *(console, motor_driver, load_cells, em_tracker, calibration, compensator),
        *(controller, supervisor, recorder, replay, conductor),
    )
)
"""Names of all nodes that the package has."""
