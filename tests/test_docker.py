"""The compose files are valid and run the nodes that there are, each once."""

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path

import pytest
import yaml

from endoscope_console import command as console_command
from endoscope_nodes.program import PROGRAMS
from endoscope_nodes.runtime.node_parameters import OF_NODE, BeatParameters
from endoscope_nodes.runtime.parameters import described

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).parents[1]
COMPOSE_FILE = ROOT / 'docker' / 'compose.yaml'
HARDWARE_FILE = ROOT / 'docker' / 'hardware.yaml'

# All nodes in one process, the clock of simulated time, the player of bags; what services run too.
STARTED_BY_HAND = {'graph', 'simulation_clock', 'replay', 'healthcheck'}
PAGE = 'web_console'


def _compose_command() -> list[str]:
    for command in (['docker', 'compose'], ['docker-compose']):
        if shutil.which(command[0]):
            done = subprocess.run([*command, 'version'], capture_output=True, check=False)
            if done.returncode == 0:
                return command
    pytest.skip('no container engine on this machine: install docker with its compose command')


def _interpolated(path: Path, **given: str) -> dict[str, dict]:
    """Services as compose sees them with an environment of these variables alone."""

    def value(match: re.Match[str]) -> str:
        name, how, other = match.groups()
        if how == ':+':
            return other if given.get(name) else ''
        return given.get(name) or (other if how == ':-' else '')

    text = re.sub(r'\$\{(\w+)(?:(:[-+?])([^}]*))?\}', value, path.read_text())
    return yaml.safe_load(text)['services']


def test_every_node_is_a_service() -> None:
    services = _interpolated(COMPOSE_FILE)
    commands = {name: shlex.split(service['command']) for name, service in services.items()}
    assert commands.pop(PAGE)[:2] == ['endoscope', 'console']
    settings = ConfigParser(interpolation=None)
    settings.read(ROOT / 'ros_ws/src/endoscope_nodes/setup.cfg', encoding='utf-8')
    scripts = settings['options.entry_points']['console_scripts']
    entry_points = {line.split(' = ')[0] for line in scripts.split('\n') if line}
    assert {words[0] for words in commands.values()} == entry_points - STARTED_BY_HAND
    assert all(w == [PROGRAMS[name].name, '--ros-args'] for name, w in commands.items())


def test_the_page_is_served_with_options_that_it_has_and_starts_no_second_graph() -> None:
    words = shlex.split(_interpolated(COMPOSE_FILE, RIG_FILE='/srv/rig.yaml')[PAGE]['command'])
    program = argparse.ArgumentParser()
    console_command.add_parser(program.add_subparsers())
    given = program.parse_args(words[1:])
    assert given.no_graph
    assert str(given.rig) == '/given/rig.yaml'
    assert f'127.0.0.1:{given.port}/' in _interpolated(COMPOSE_FILE)[PAGE]['healthcheck']['test'][3]


@pytest.mark.parametrize('files', [(COMPOSE_FILE,), (COMPOSE_FILE, HARDWARE_FILE)])
def test_rig_and_plant_files_are_named_by_the_environment(files) -> None:
    given = {'RIG_FILE': '/srv/my rig.yaml', 'PLANT_FILE': '/srv/plant.yaml'}
    mounts = {
        '/srv/my rig.yaml:/given/rig.yaml:ro': '/given/rig.yaml',
        '/srv/plant.yaml:/given/plant.yaml:ro': '/given/plant.yaml',
    }
    first = _interpolated(COMPOSE_FILE, **given)
    for path in files:
        for name, service in _interpolated(path, **given).items():
            words = shlex.split(service['command'])
            there = {mounts[v] for v in first[name]['volumes'] if v in mounts}
            used = {word.partition(':=')[2] or word for word in words if '/given/' in word}
            assert '/given/rig.yaml' in used
            assert used <= there
            simulated = path == COMPOSE_FILE and name in (
                'motor_driver',
                'load_cells',
                'em_tracker',
                'watch',
                'tip_force',
            )
            assert ('/given/plant.yaml' in used) == simulated, name
            parameters = re.findall(r'-p (\w+):=', service['command'])
            declared = {
                one.name
                for kind in (BeatParameters, *OF_NODE.get(name, ()))
                for one in described(kind)
            }
            assert set(parameters) <= declared
    assert '/given/' not in str([s['command'] for s in _interpolated(COMPOSE_FILE).values()])


def test_a_container_finds_what_the_image_has_compiled(tmp_path) -> None:
    program = [
        sys.executable,
        '-c',
        'from endoscope_core.hysteresis.dahl import dahl_step as d; d(0.1, 0.1, 0.2, 1.0)',
    ]
    environment = os.environ | {'NUMBA_DEBUG_CACHE': '1'}
    environment.pop('NUMBA_CACHE_DIR', None)
    compiled = environment | {'XDG_CACHE_HOME': str(tmp_path / 'compiled')}
    said = subprocess.run(program, env=compiled, capture_output=True, text=True, check=True)
    assert 'data saved' in said.stdout
    # The entrypoint with the folders of this test, and without the ROS of the image.
    lines = (ROOT / 'docker' / 'entrypoint').read_text().replace('/endoscope/', f'{tmp_path}/')
    entrypoint = tmp_path / 'entrypoint'
    entrypoint.write_text(re.sub('(?m)^source .*$', '', lines))
    later = environment | {'XDG_CACHE_HOME': str(tmp_path / 'memory')}
    command = ['bash', str(entrypoint), *program]
    said = subprocess.run(command, env=later, capture_output=True, text=True, check=True)
    assert 'data loaded' in said.stdout
    assert 'data saved' not in said.stdout


def test_services_share_image_network_and_user_and_may_do_no_more_than_they_have_to() -> None:
    compose = yaml.safe_load(COMPOSE_FILE.read_text())
    services = compose['services']
    for key in ('network_mode', 'user', 'environment', 'image'):
        assert len({str(service[key]) for service in services.values()}) == 1, key
    [built] = [service['build'] for service in services.values() if 'build' in service]
    assert built['target'] == 'robot'
    for name, service in services.items():
        assert service['pull_policy'] == 'never'
        assert service['restart'] == 'no', name
        assert service['read_only'] is True
        assert service['cap_drop'] == ['ALL']
        assert 'cap_add' not in service
        assert 'privileged' not in service
        assert service['security_opt'] == ['no-new-privileges:true']
        assert service['ulimits'] == {'rtprio': 99, 'memlock': -1}
        if name != PAGE:
            assert service['healthcheck']['test'][-2:] == ['healthcheck', name]
    # Hardware takes nothing of that back.
    hardened = set(compose['x-node']) - {'command', 'volumes'}
    for name, service in yaml.safe_load(HARDWARE_FILE.read_text())['services'].items():
        assert not (hardened | {'cap_add', 'privileged', 'healthcheck'}) & set(service)
        node, *arguments = service['command'].split()
        assert node == name in services
        assert 'device' in re.findall(r'-p (\w+):=', ' '.join(arguments))


def test_the_image_is_built_on_what_is_pinned_and_runs_as_nobody_special() -> None:
    lines = (ROOT / 'docker' / 'Dockerfile').read_text().splitlines()
    stages = [line for line in lines if line.startswith('FROM')]
    assert stages == ['FROM ${ROS_IMAGE} AS robot', 'FROM robot AS lab']
    [image] = [line for line in lines if line.startswith('ARG ROS_IMAGE')]
    assert re.fullmatch(r'ARG ROS_IMAGE=ros:jazzy@sha256:[0-9a-f]{64}', image)
    # A stage ends as nobody special, whoever installs something in between.
    robot, lab = ' '.join(lines).split(stages[1])
    for stage in (robot, lab):
        user = stage.split('USER ')[-1].split()[0]
        assert user.split(':')[0] not in ('0', 'root')


def test_compose_accepts_the_files() -> None:
    compose = [*_compose_command(), '--file', str(COMPOSE_FILE)]

    def run(*words: str, **given: str) -> subprocess.CompletedProcess[str]:
        command, environment = [*compose, *words], os.environ | given
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    done = run('config', '--services')
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) == set(yaml.safe_load(COMPOSE_FILE.read_text())['services'])
    hardware = ('--file', str(HARDWARE_FILE), 'config')
    ports = {'MOTOR_PORT': '/dev/ttyUSB0', 'LOAD_CELL_PORT': '/dev/ttyUSB1'}
    done = run(*hardware, **ports, TRACKER_PORT='/dev/ttyUSB2', RIG='/srv/rig')
    assert done.returncode == 0, done.stderr
    motors = yaml.safe_load(done.stdout)['services']['motor_driver']
    assert 'device:=dynamixel' in motors['command']
    without_ports = run(*hardware)
    assert without_ports.returncode != 0
    assert '_PORT' in without_ports.stderr or 'RIG' in without_ports.stderr


def test_the_image_of_a_robot_gets_colcon_alone_beside_what_its_programs_need() -> None:
    dockerfile = (ROOT / 'docker' / 'Dockerfile').read_text()
    [words] = re.findall(r'make -C ros_ws (LAB= .*?) \\', dockerfile)
    # Whatever is installed here already counts as missing.
    planned = subprocess.run(
        ['make', '--always-make', '--dry-run', '-C', ROOT / 'ros_ws', *words.split()],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    locks = set(re.findall(r'--requirement requirements-(\w+)\.lock', planned))
    assert locks - {'ros'} == {'uv', 'colcon'}
    assert not re.search('--editable src/endoscope_(emulators|lab)', planned)
    assert '--packages-ignore endoscope_emulators endoscope_lab' in planned


def test_files_that_the_image_names_exist() -> None:
    dockerfile = (ROOT / 'docker' / 'Dockerfile').read_text()
    entry_point = re.search(r'ENTRYPOINT \["/endoscope/([^"]+)"\]', dockerfile)
    assert entry_point is not None
    assert (ROOT / entry_point.group(1)).stat().st_mode & 0o111
