from setuptools import find_packages, setup

package_name = 'endoscope_nodes'
shipped_suffixes = ('csv', 'css', 'j2', 'js', 'json', 'npz', 'pt', 'svg', 'xml', 'yaml')

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={'': ['py.typed', *('**/*.' + suffix for suffix in shipped_suffixes)]},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=False,
    maintainer='The endoscope founders',
    maintainer_email='founders@endoscope.invalid',
    description='The rclpy nodes of the master-slave endoscope.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'console = endoscope_nodes.console_node:main',
            'motor_driver = endoscope_nodes.motor_driver_node:main',
            'load_cells = endoscope_nodes.load_cells_node:main',
            'em_tracker = endoscope_nodes.em_tracker_node:main',
            'calibration = endoscope_nodes.calibration_node:main',
            'compensator = endoscope_nodes.compensator_node:main',
            'controller = endoscope_nodes.controller_node:main',
            'supervisor = endoscope_nodes.supervisor_node:main',
            'recorder = endoscope_nodes.recorder_node:main',
            'replay = endoscope_nodes.replay_node:main',
            'conductor = endoscope_nodes.conductor_node:main',
            'graph = endoscope_nodes.graph:main',
        ]
    },
)
