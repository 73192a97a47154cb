"""The compose file is valid and runs the nodes that there are, each once."""

import ast
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
COMPOSE_FILE = ROOT / 'docker' / 'compose.yaml'

# All nodes in one process, the clock of simulated time, and the player of bags.
STARTED_BY_HAND = {'graph', 'conductor', 'replay'}


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
    pytest.skip('neither docker compose nor docker-compose is installed')


def test_every_node_is_a_service() -> None:
    services = yaml.safe_load(COMPOSE_FILE.read_text())['services']
    commands = {service['command'] for service in services.values()}
    assert commands == _entry_points_of_nodes() - STARTED_BY_HAND
    assert all(name == service['command'] for name, service in services.items())


def test_nodes_share_one_network_domain_and_user() -> None:
    services = yaml.safe_load(COMPOSE_FILE.read_text())['services'].values()
    for key in ('network_mode', 'ipc', 'user', 'environment', 'image'):
        assert len({str(service[key]) for service in services}) == 1, key


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


def test_files_that_the_image_names_exist() -> None:
    dockerfile = (ROOT / 'docker' / 'Dockerfile').read_text()
    entry_point = re.search(r'ENTRYPOINT \["/endoscope/([^"]+)"\]', dockerfile)
    assert entry_point is not None
    assert (ROOT / entry_point.group(1)).stat().st_mode & 0o111
