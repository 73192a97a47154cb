"""Starts the endoscope: all nodes in one process, or each in its own.

    ros2 launch endoscope_bringup endoscope.launch.py
    ros2 launch endoscope_bringup endoscope.launch.py processes:=many plant_file:=plant.yaml
    ros2 launch endoscope_bringup endoscope.launch.py use_sim_time:=true

One process is the default because two cores carry the graph at 1 kHz that way only.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction
from launch.conditions import IfCondition
from launch.substitutions import EqualsSubstitution, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node, SetParameter
from launch_ros.substitutions import FindPackageShare

SIMULATED_DEVICES = ('motor_driver', 'load_cells', 'em_tracker')
OTHERS = (
    *('supervisor', 'compensator', 'controller', 'calibration', 'console'),
    *('instrument_model', 'recorder'),
)


def _if(name: str, value: str) -> IfCondition:
    return IfCondition(EqualsSubstitution(LaunchConfiguration(name), value))


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the nodes."""
    config = LaunchConfiguration('config')
    plant = {'plant_file': LaunchConfiguration('plant_file')}
    composed = Node(
        package='endoscope_nodes', executable='graph', parameters=[config, plant], output='screen'
    )
    processes = [
        *(
            Node(package='endoscope_nodes', executable=name, parameters=[config, plant])
            for name in SIMULATED_DEVICES
        ),
        *(Node(package='endoscope_nodes', executable=name, parameters=[config]) for name in OTHERS),
    ]
    conductor = Node(
        package='endoscope_nodes',
        executable='conductor',
        parameters=[config],
        condition=_if('use_sim_time', 'true'),
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'config',
                default_value=PathJoinSubstitution(
                    [FindPackageShare('endoscope_bringup'), 'config', 'endoscope.yaml']
                ),
                description='parameters of the nodes',
            ),
            DeclareLaunchArgument(
                'plant_file',
                default_value='',
                description='plant.yaml of the simulated slave; empty for the nominal plant',
            ),
            DeclareLaunchArgument(
                'processes',
                default_value='one',
                choices=['one', 'many'],
                description='all nodes in one process, or each in its own',
            ),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='false',
                choices=['true', 'false'],
                description='lock-step simulated time instead of real time',
            ),
            SetParameter('use_sim_time', LaunchConfiguration('use_sim_time')),
            GroupAction([composed], condition=_if('processes', 'one')),
            GroupAction([*processes, conductor], condition=_if('processes', 'many')),
        ]
    )
