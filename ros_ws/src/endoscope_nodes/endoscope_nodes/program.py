"""The programs of the nodes: each can be stopped and asked for help before anything is loaded."""

import importlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from endoscope_core.exit_status import exit_status
from endoscope_nodes.runtime.stop_signals import end_when_asked

REAL_TIME = '--real-time'
CHECK = '--check'
_ROS_ARGS = '--ros-args'
_END_OF_ROS_ARGS = '--'
_HELP = ('-h', '--help')


@dataclass(frozen=True)
class Program:
    """One command of the package."""

    name: str
    runs: str  # ``module:Node`` of this package, or ``module:function`` for several nodes
    purpose: str  # a sentence or two
    composed: tuple[str, ...] = ()  # nodes that it runs; empty for a single one
    options: tuple[tuple[str, str], ...] = ()  # words of its own, and what each does

    @property
    def nodes(self) -> tuple[str, ...]:
        """Node names of what it runs."""
        return self.composed or (self.name,)

    def __call__(self, argv: Sequence[str] | None = None) -> int:
        """Run it with a command line without its name (default: `sys.argv`); the exit status."""
        end_when_asked(self.name)
        return exit_status(self.name, lambda: self._run(sys.argv[1:] if argv is None else argv))

    def _run(self, argv: Sequence[str]) -> int:
        # Wherever it stands: nobody who asks for help wants to see motors start.
        if set(_HELP) & set(argv):
            from endoscope_nodes.node_help import help_of

            print(help_of(self.name, self.purpose, self.nodes, self.options))
            return 0
        words = [word for word in words_for_nobody(argv) if word not in dict(self.options)]
        if words:
            print(
                f"{self.name}: unknown argument '{words[0]}'; parameters go behind {_ROS_ARGS} "
                f'(see {self.name} --help)',
                file=sys.stderr,
            )
            return 2
        return self.start()

    def start(self) -> int:
        """Run its nodes with `sys.argv` until they are stopped; the exit status."""
        module, _, name = self.runs.partition(':')
        found = getattr(importlib.import_module(f'endoscope_nodes.{module}'), name)
        if self.composed:
            return int(found())
        from endoscope_nodes.runtime.runtime import run_nodes

        return run_nodes([found])


def words_for_nobody(argv: Sequence[str]) -> list[str]:
    """Return the words of a command line that are not ROS arguments."""
    # Those stand between --ros-args and -- or the end, as often as one likes; see
    # https://design.ros2.org/articles/ros_command_line_arguments.html.
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


master = Program(
    'master',
    'nodes.master:MasterNode',
    'Turns the motion of the handle into commands while the clutch is held, or plays a motion or '
    'a file.',
)
motor_driver = Program(
    'motor_driver',
    'nodes.motor_driver:MotorDriverNode',
    'Drives the motors of the slave as far as it is safe, simulated or on a bus of servos, and '
    'publishes what the shafts do.',
)
load_cells = Program(
    'load_cells',
    'nodes.load_cells:LoadCellsNode',
    'Measures the tensions of the wires, simulated or behind a Modbus transmitter.',
)
em_tracker = Program(
    'em_tracker',
    'nodes.em_tracker:EmTrackerNode',
    'Measures the pose of the tip and from it the bending, simulated or by an electromagnetic '
    'tracker.',
)
supervisor = Program(
    'supervisor',
    'nodes.supervisor:SupervisorNode',
    'Decides whether the slave may move: opens motion sessions, and ends them where anything '
    'vital fails.',
)
compensator = Program(
    'compensator',
    'nodes.compensator:CompensatorNode',
    'Turns desired bending into commands for the motors that make up for the hysteresis.',
)
controller = Program(
    'controller',
    'nodes.controller:ControllerNode',
    'Learns from the tracker what the compensation leaves over, and corrects it.',
)
calibration = Program(
    'calibration',
    'nodes.calibration:CalibrationNode',
    'Moves the slave as a calibration asks, finds the hysteresis class of its tube from the '
    'tensions, and takes the slave home.',
)
instrument_model = Program(
    'instrument_model',
    'nodes.instrument_model:InstrumentModelNode',
    'Shows other programs the instrument and its bending: a description as URDF, the angles of its '
    'joints, and where its links are.',
)
watch = Program(
    'watch',
    'nodes.watch:WatchNode',
    'Compares the rig with its plant while it moves, where it is switched on, and reports that the '
    'rig no longer matches its plant, and where.',
)
tip_force = Program(
    'tip_force',
    'nodes.tip_force:TipForceNode',
    'Works out from wires, motors and tracker with what force something pushes the tip aside.',
)
recorder = Program(
    'recorder',
    'nodes.recorder:RecorderNode',
    'Records every message of the interface into a bag, counted, with what was lost.',
)
replay = Program(
    'replay',
    'nodes.replay:ReplayNode',
    'Publishes the topics of a bag again, at their pace or another, and ends.',
)
simulation_clock = Program(
    'simulation_clock',
    'nodes.simulation_clock:SelfStartingClock',
    'Makes simulated time, a millisecond at a time, as fast as the graph can follow.',
)

_COMPOSED = (
    *(motor_driver, load_cells, em_tracker, supervisor),
    *(compensator, controller, calibration, master, instrument_model, watch, tip_force),
    recorder,
)
PROGRAMS = {program.nodes[0]: program for program in (*_COMPOSED, replay, simulation_clock)}
"""The program of each node of the package, by node name."""
NODES = tuple(PROGRAMS)
"""Node names of all that the package has."""

graph = Program(
    'graph',
    'graph:main',
    'Runs all nodes in one process. Where all devices are simulated, it runs in lock-step with a '
    'simulation clock, at real time where the machine can and slower where it cannot; '
    '-p speed:=0.0 lets it go as fast as it can.',
    tuple(program.nodes[0] for program in (*_COMPOSED, simulation_clock)),
    (
        (REAL_TIME, 'by the wall clock, as with a real device: a machine that is busy ends motion'),
        (CHECK, 'only say which rate this machine carries in real time, as busy as it is now'),
    ),
)
