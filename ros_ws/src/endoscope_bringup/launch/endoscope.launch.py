"""Starts the endoscope: all nodes in one process, or each in its own.

    ros2 launch endoscope_bringup endoscope.launch.py
    ros2 launch endoscope_bringup endoscope.launch.py rig_file:=rig.yaml namespace:=left
    ros2 launch endoscope_bringup endoscope.launch.py processes:=many plant_file:=plant.yaml

One process is the default because two cores carry the graph at 1 kHz that way only.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction
from launch.conditions import IfCondition
from launch.substitutions import (
    AndSubstitution,
    EqualsSubstitution,
    LaunchConfiguration,
    NotSubstitution,
    PathJoinSubstitution,
)
from launch_ros.actions import Node, SetParameter
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PROGRAMS = (
    *('motor_driver', 'load_cells', 'em_tracker'),
    *('supervisor', 'compensator', 'controller', 'calibration', 'master'),
    *('instrument_model', 'watch', 'tip_force', 'recorder'),
)


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the nodes."""
    real_time = LaunchConfiguration('real_time')
    many = EqualsSubstitution(LaunchConfiguration('processes'), 'many')
    in_lock_step = IfCondition(AndSubstitution(many, NotSubstitution(real_time)))

    def node(executable: str, **others: object) -> Node:
        files = {
            name: ParameterValue(LaunchConfiguration(name), value_type=str)
            for name in ('rig_file', 'plant_file')
        }
        return Node(
            package='endoscope_nodes',
            executable=executable,
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('config'), files],
            # Of every process: the recorder keeps more where the rig is watched.
            ros_arguments=['-p', ['watch:active:=', LaunchConfiguration('watch')]],
            output='screen',
            **others,
        )

    def argument(name: str, default: object, words: str, **how: object) -> DeclareLaunchArgument:
        return DeclareLaunchArgument(name, default_value=default, description=words, **how)

    return LaunchDescription(
        [
            argument(
                'config',
                PathJoinSubstitution(
                    [FindPackageShare('endoscope_bringup'), 'config', 'endoscope.yaml']
                ),
                'parameters of the nodes',
            ),
            argument('namespace', 'endoscope', 'of all nodes and topics'),
            argument('rig_file', '', 'rig.yaml with devices and limits; empty for the shipped one'),
            argument(
                'plant_file', '', 'plant.yaml of the simulated slave; empty for that of the rig'
            ),
            argument(
                'processes',
                'one',
                'all nodes in one process, or each in its own',
                choices=['one', 'many'],
            ),
            argument(
                'real_time',
                'false',
                'true for the wall clock: a rig with a real device needs it where each node has a '
                'process, and one process takes it there by itself',
                choices=['true', 'false'],
            ),
            argument(
                'watch',
                'false',
                'whether the rig is compared with its plant while it moves',
                choices=['true', 'false'],
            ),
            # In one process the graph decides for itself unless this is given.
            SetParameter('use_sim_time', False, condition=IfCondition(real_time)),
            SetParameter('use_sim_time', True, condition=in_lock_step),
            GroupAction([node('graph')], condition=IfCondition(NotSubstitution(many))),
            GroupAction([node(name) for name in PROGRAMS], condition=IfCondition(many)),
            # The simulation clock gives the time, no faster than the wall clock.
            GroupAction(
                [SetParameter('speed', 1.0), node('simulation_clock')], condition=in_lock_step
            ),
        ]
    )
