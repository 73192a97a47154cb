from pathlib import Path

from setuptools import find_packages, setup

package_name = 'endoscope_bringup'
shipped_suffixes = ('csv', 'css', 'j2', 'js', 'json', 'svg', 'yaml')
share_folders = ('config', 'launch', 'layouts', 'urdf')


def shared_files() -> list[tuple[str, list[str]]]:
    """Place every file of the share folders at the same path below share/PACKAGE."""
    files = [
        path
        for folder in share_folders
        for path in Path(folder).rglob('*')
        if path.is_file() and path.suffix != '.pyc'
    ]
    return [(f'share/{package_name}/{path.parent}', [str(path)]) for path in sorted(files)]


setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={'': ['py.typed', *('**/*.' + suffix for suffix in shipped_suffixes)]},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml', 'LICENSE']),
        *shared_files(),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=False,
    maintainer='The endoscope founders',
    maintainer_email='founders@endoscope.invalid',
    description='Command line, configuration and launch files of the endoscope.',
    license='Apache-2.0',
    entry_points={'console_scripts': ['endoscope = endoscope_bringup.cli:main']},
)
