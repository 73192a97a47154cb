from setuptools import find_packages, setup

package_name = 'endoscope_console'
shipped_suffixes = ('css', 'html', 'js', 'json', 'svg', 'xml')

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
    description='The operator console in the browser: endoscope console.',
    license='Apache-2.0',
    entry_points={'endoscope.commands': ['console = endoscope_console.command']},
)
