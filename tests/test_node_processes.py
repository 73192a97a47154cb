"""Nodes as processes of their own: how they stop, and what they refuse to start with."""

import os
import signal
import subprocess
import sys
import time

import pytest

NODES = (
    'console',
    'motor_driver',
    'load_cells',
    'em_tracker',
    'supervisor',
    'compensator',
    'controller',
)


def start(node, *args, domain=231):
    module = f'endoscope_nodes.{node}_node' if node != 'graph' else 'endoscope_nodes.graph'
    code = f'import sys; from {module} import main; print("begin", flush=True); sys.exit(main())'
    return subprocess.Popen(
        [sys.executable, '-c', code, '--ros-args', *args],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {'ROS_DOMAIN_ID': str(domain)},
    )


@pytest.mark.parametrize('node', NODES)
@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_a_node_cleanly(node, number):
    process = start(node)
    assert process.stdout.readline() == 'begin\n'
    time.sleep(2.0)
    process.send_signal(number)
    out, errors = process.communicate(timeout=30)
    assert process.returncode == 0, errors
    assert 'Traceback' not in out + errors


@pytest.mark.parametrize(
    ('node', 'override', 'words'),
    [
        ('console', 'sorce:=motion', "console: unknown parameter 'sorce'; did you mean 'source'?"),
        (
            'console',
            'scale:=.nan',
            "console: parameter 'scale' is nan; give a finite number, from 0.01 to 10",
        ),
        ('console', 'scale:=99.0', "console: parameter 'scale' is 99.0; give"),
        ('console', 'source:=motin', 'did you mean motion?'),
        ('compensator', 'mode:=bouc_when', 'did you mean bouc_wen?'),
        ('motor_driver', 'seed:=-1', "motor_driver: parameter 'seed' is -1; give a whole number"),
        ('motor_driver', 'plant_file:=nowhere.yaml', 'nowhere.yaml'),
        (
            'load_cells',
            'connected:=3',
            "load_cells: parameter 'connected' is 3; give true or false",
        ),
    ],
)
def test_wrong_parameters_are_one_line_and_exit_code_2(node, override, words):
    process = start(node, '-p', override)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 2
    assert words in errors
    assert len(errors.strip().splitlines()) == 1
