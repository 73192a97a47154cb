from setuptools import find_packages, setup

package_name = 'endoscope_emulators'
shipped_suffixes = ('csv', 'css', 'j2', 'js', 'json', 'svg', 'yaml')

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
    description='Emulated servos, load cells, tracker and cables, for tests and benchmarks.',
    license='Apache-2.0',
    entry_points={'console_scripts': []},
)
