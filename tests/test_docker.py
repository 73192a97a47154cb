"""The compose files are valid and run the nodes that there are, each once."""

import ast
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from endoscope_nodes.node_parameters import OF_NODE
from endoscope_nodes.parameters import described

ROOT = Path(__file__).parents[1]
COMPOSE_FILE = ROOT / 'docker' / 'compose.yaml'
HARDWARE_FILE = ROOT / 'docker' / 'hardware.yaml'

# All nodes in one process, the clock of simulated time, the player of bags; what services run too.
STARTED_BY_HAND = {'graph', 'conductor', 'replay', 'healthcheck'}


def _entry_points_of_nodes() -> set[str]:
    setup = ast.parse((ROOT / 'ros_ws/src/endoscope_nodes/setup.py').read_text())
    strings = [str(node.value) for node in ast.walk(setup) if isinstance(node, ast.Constant)]
    return {text.split(' = ')[0] for text in strings if re.fullmatch(r'\w+ = [\w.]+:\w+', text)}


def _compose_command() -> list[str]:
    for command in (['docker', 'compose'], ['docker-compose']):
        if shutil.which(command[0]):
            done = subprocess.run([*command, 'version'], capture_output=True, check=False)
            if done.returncode == 0:
                return command
    pytest.skip('no container engine on this machine: install docker with its compose command')


def test_every_node_is_a_service() -> None:
    services = yaml.safe_load(COMPOSE_FILE.read_text())['services']
    commands = {service['command'] for service in services.values()}
    assert commands == _entry_points_of_nodes() - STARTED_BY_HAND
    assert all(name == service['command'] for name, service in services.items())


def test_nodes_share_one_network_domain_and_user() -> None:
    services = yaml.safe_load(COMPOSE_FILE.read_text())['services'].values()
    for key in ('network_mode', 'ipc', 'user', 'environment', 'image'):
        assert len({str(service[key]) for service in services}) == 1, key


def test_no_service_may_do_more_than_it_has_to() -> None:
    for name, service in yaml.safe_load(COMPOSE_FILE.read_text())['services'].items():
        assert service['restart'] == 'no', name
        assert service['read_only'] is True
        assert service['cap_drop'] == ['ALL']
        assert 'cap_add' not in service
        assert 'privileged' not in service
        assert service['security_opt'] == ['no-new-privileges:true']
        assert service['ulimits'] == {'rtprio': 99, 'memlock': -1}
        assert service['healthcheck']['test'][-2:] == ['healthcheck', name]


def test_hardware_takes_nothing_of_that_back() -> None:
    hardened = set(yaml.safe_load(COMPOSE_FILE.read_text())['x-node']) - {'command'}
    for service in yaml.safe_load(HARDWARE_FILE.read_text())['services'].values():
        assert not hardened & set(service)
        assert not {'cap_add', 'privileged', 'healthcheck'} & set(service)


def test_the_image_is_built_on_what_is_pinned_and_runs_as_nobody_special() -> None:
    lines = (ROOT / 'docker' / 'Dockerfile').read_text().splitlines()
    assert [line for line in lines if line.startswith('FROM')] == ['FROM ${ROS_IMAGE}']
    [image] = [line for line in lines if line.startswith('ARG ROS_IMAGE')]
    assert re.fullmatch(r'ARG ROS_IMAGE=ros:jazzy@sha256:[0-9a-f]{64}', image)
    [user] = [line.split()[1] for line in lines if line.startswith('USER')]
    assert user.split(':')[0] not in ('0', 'root')


def test_compose_accepts_the_file() -> None:
    command = _compose_command()
    done = subprocess.run(
        [*command, '--file', str(COMPOSE_FILE), 'config', '--services'],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) == set(yaml.safe_load(COMPOSE_FILE.read_text())['services'])


def test_hardware_changes_how_nodes_are_started_and_only_by_parameters_that_they_have() -> None:
    services = yaml.safe_load(COMPOSE_FILE.read_text())['services']
    for name, service in yaml.safe_load(HARDWARE_FILE.read_text())['services'].items():
        assert name in services
        node, *arguments = service['command'].split()
        assert node == name
        given = re.findall(r'-p (\w+):=', ' '.join(arguments))
        assert 'device' in given
        declared = {one.name for kind in OF_NODE[name] for one in described(kind)}
        assert set(given) <= declared


def test_compose_accepts_the_hardware() -> None:
    command = [*_compose_command(), '--file', str(COMPOSE_FILE), '--file', str(HARDWARE_FILE)]
    ports = {'MOTOR_PORT': '/dev/ttyUSB0', 'LOAD_CELL_PORT': '/dev/ttyUSB1'}
    rig = {'TRACKER_PORT': '/dev/ttyUSB2', 'RIG': '/srv/rig'}
    done = subprocess.run(
        [*command, 'config'],
        env=os.environ | ports | rig,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    motors = yaml.safe_load(done.stdout)['services']['motor_driver']
    assert 'device:=dynamixel' in motors['command']
    without_ports = subprocess.run(
        [*command, 'config'], capture_output=True, text=True, check=False
    )
    assert without_ports.returncode != 0
    assert '_PORT' in without_ports.stderr or 'RIG' in without_ports.stderr


def test_files_that_the_image_names_exist() -> None:
    dockerfile = (ROOT / 'docker' / 'Dockerfile').read_text()
    entry_point = re.search(r'ENTRYPOINT \["/endoscope/([^"]+)"\]', dockerfile)
    assert entry_point is not None
    assert (ROOT / entry_point.group(1)).stat().st_mode & 0o111
