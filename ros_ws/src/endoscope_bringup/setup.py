from setuptools import find_packages, setup

package_name = 'endoscope_bringup'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=False,
    maintainer='The endoscope founders',
    maintainer_email='founders@endoscope.invalid',
    description='Command line, configuration and launch files of the endoscope.',
    license='Apache-2.0',
    entry_points={'console_scripts': ['endoscope = endoscope_bringup.cli:main']},
)
