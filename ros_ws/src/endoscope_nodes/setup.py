from setuptools import find_packages, setup

package_name = 'endoscope_nodes'
shipped_suffixes = ('csv', 'css', 'j2', 'js', 'json', 'svg', 'xml', 'yaml')

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={'': ['py.typed', *('**/*.' + suffix for suffix in shipped_suffixes)]},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml', 'LICENSE']),
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
            'console = endoscope_nodes.program:console',
            'motor_driver = endoscope_nodes.program:motor_driver',
            'load_cells = endoscope_nodes.program:load_cells',
            'em_tracker = endoscope_nodes.program:em_tracker',
            'calibration = endoscope_nodes.program:calibration',
            'compensator = endoscope_nodes.program:compensator',
            'controller = endoscope_nodes.program:controller',
            'supervisor = endoscope_nodes.program:supervisor',
            'instrument_model = endoscope_nodes.program:instrument_model',
            'recorder = endoscope_nodes.program:recorder',
            'replay = endoscope_nodes.program:replay',
            'conductor = endoscope_nodes.program:conductor',
            'graph = endoscope_nodes.program:graph',
            'healthcheck = endoscope_nodes.healthcheck:main',
        ]
    },
)
