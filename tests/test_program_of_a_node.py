"""What a node's program does with its command line and with signals, from its first moment on."""

import importlib
import os
import re
import signal
import subprocess
import sys
import time
from multiprocessing import active_children
from pathlib import Path
from random import Random

import pytest
from node_program import code_of

from endoscope_core.atomic_output import atomic_directory
from endoscope_lab.faults.process_rig import ProcessRig
from endoscope_nodes import program
from endoscope_nodes.node_help import help_of
from endoscope_nodes.program import NODES, words_for_nobody
from endoscope_nodes.runtime.node_parameters import OF_NODE, OF_PROCESS
from endoscope_nodes.runtime.parameters import described
from endoscope_nodes.runtime.private_domain import private_domain

PATIENCE_S = 120.0
# The last bytes of a complete file: https://mcap.dev/spec.
MCAP_MAGIC = b'\x89MCAP0\r\n'
STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
WORDS = {signal.SIGINT: 'interrupted', signal.SIGHUP: 'hung up'}


def start(name, *args, on_hangup=signal.SIG_DFL, environment=None, **options):
    # The tests themselves may have been started by `nohup`.
    hangup = f'import signal; signal.signal(signal.SIGHUP, signal.{on_hangup.name})'
    return subprocess.Popen(
        [sys.executable, '-c', f'{hangup}; {code_of(name)}', *args],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | (environment or {'ROS_DOMAIN_ID': str(private_domain())}),
        **options,
    )


def ended(name, *args, **options):
    process = start(name, *args, **options)
    out, errors = process.communicate(timeout=PATIENCE_S)
    return process.returncode, out, errors


def mask_of_signals(process, kind):
    """Read a mask of proc(5): SigCgt of the signals caught, SigIgn of those ignored."""
    lines = Path(f'/proc/{process.pid}/status').read_text().splitlines()
    [mask] = [line.split()[1] for line in lines if line.startswith(kind)]
    return int(mask, 16) << 1


def wait_until_it_catches_signals(process):
    """Wait for the last of the handlers."""
    deadline = time.monotonic() + PATIENCE_S
    while not mask_of_signals(process, 'SigCgt') >> STOPPING[-1] & 1:
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < deadline, 'it catches no signals'


def wait_for_line(process, words):
    for line in process.stderr:
        if words in line:
            return
    pytest.fail(f'it never said {words!r}')


@pytest.mark.parametrize(
    ('name', 'number'), [('graph', signal.SIGINT), ('recorder', signal.SIGHUP)]
)
def test_a_signal_while_it_starts_is_one_line(tmp_path, name, number):
    process = start(name, '--ros-args', '-p', f'bag:={tmp_path / "bag"}')
    wait_until_it_catches_signals(process)
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert errors == f'{name}: {WORDS[number]} while starting\n'
    assert process.returncode == 128 + number
    assert not (tmp_path / 'bag').exists()


def test_a_recording_is_finished_once_however_often_it_is_asked_for(tmp_path):
    process = start('recorder', '--ros-args', '-p', f'bag:={tmp_path / "bag"}')
    wait_for_line(process, 'recording to')
    while process.poll() is None:
        for number in STOPPING:
            process.send_signal(number)
        time.sleep(0.002)
    errors = process.stderr.read()
    assert process.returncode == 0, errors
    assert [line for line in errors.splitlines() if ' lost' in line] == errors.splitlines()[-1:]
    assert '0 lost' in errors
    assert (tmp_path / 'bag' / 'metadata.yaml').is_file()
    assert (tmp_path / 'bag' / 'bag_0.mcap').read_bytes().endswith(MCAP_MAGIC)


@pytest.mark.nightly
def test_one_started_by_nohup_outlives_the_terminal_and_is_called_what_it_will_be(tmp_path):
    with atomic_directory(tmp_path / 'demo') as partial:
        bag = ['-p', f'bag:={partial / "bag"}']
        process = start('recorder', '--ros-args', *bag, on_hangup=signal.SIG_IGN)
        wait_for_line(process, f'recording to {tmp_path / "demo" / "bag"}\n')
        assert mask_of_signals(process, 'SigIgn') >> signal.SIGHUP & 1
        process.terminate()
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, errors
    assert '.partial' not in errors
    assert f'{tmp_path / "demo" / "bag"}: 0 messages, 0 lost' in errors


@pytest.mark.parametrize(
    ('words', 'pace'),
    [
        ([], 'in simulated time, no faster than real time'),
        pytest.param(['--real-time'], 'at 200 Hz', marks=pytest.mark.nightly),
    ],
)
def test_the_graph_says_what_it_was_given_when_it_is_ready_and_what_to_do(tmp_path, words, pace):
    parameters = tmp_path / 'rig.yaml'
    parameters.write_text('/**/master: {ros__parameters: {source: none, scale: 0.5}}\n')
    process = start(
        'graph',
        *words,
        *('--ros-args', '--params-file', str(parameters), '-p', 'tick_rate:=200'),
        *('-p', 'autostart:=false', '-r', '__ns:=/left'),
    )
    told = []
    for line in process.stderr:
        told.append(line.partition('] [')[2].partition('] [')[2].strip())
        if '[WARN]' not in line and 'ready in' in line:
            break
    process.terminate()
    process.communicate(timeout=PATIENCE_S)
    assert [line for line in told if ' with ' in line] == [
        'left.motor_driver]: with tick_rate:=200',
        'left.master]: with scale:=0.5',
        'left.recorder]: with autostart:=false',
    ]
    assert told[-1] == (
        f'graph]: ready in /left {pace}: motors simulated; load cells simulated; '
        'tracker simulated; slave DISABLED; next: endoscope operate enable --namespace left; '
        'not recording: endoscope operate record start --namespace left'
    )


def test_a_node_alone_says_what_it_waits_for():
    process = start('supervisor')
    wait_for_line(process, 'not ready yet: motor/measured_js has not been received')
    process.terminate()
    process.communicate(timeout=PATIENCE_S)


@pytest.mark.parametrize('node', ['graph', *NODES])
def test_help_tells_every_parameter(node):
    asked = program.graph if node == 'graph' else program.PROGRAMS[node]
    out = help_of(asked.name, asked.purpose, asked.nodes, asked.options)
    assert out.startswith(f'usage: {asked.name} ')
    told = ' '.join(out.split())
    for one in set(NODES) - {'replay'} if node == 'graph' else [node]:
        for kind in (*OF_NODE[one], *OF_PROCESS):
            for parameter in described(kind):
                mark = '* ' if parameter.dynamic else ''
                assert f'{mark}-p {parameter.name}:={parameter.default} ' in told
                assert parameter.description in told
                assert f'{parameter.allowed} {parameter.unit}'.strip() in told


def test_who_asks_for_help_gets_it_and_loads_neither_ros_nor_anything_that_computes():
    code = (
        'import sys\n'
        'from endoscope_nodes.program import graph, master\n'
        "graph(['--ros-args', '-r', '__ns:=/left', '--', '--help'])\n"
        "master(['--ros-args', '-p', 'source:=motion', '-h'])\n"
        "heavy = {'rclpy', 'rcl_interfaces', 'numpy', 'numba', 'scipy', 'torch', 'yaml'}\n"
        'sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)\n'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, '')
    assert re.findall('(?m)^usage: (.*?) ', done.stdout) == ['graph', 'master']


@pytest.mark.parametrize(
    ('args', 'words'),
    [
        (['start'], "recorder: unknown argument 'start'; parameters go behind --ros-args"),
        pytest.param(
            ['--ros-args', '--log-levl', 'info'],
            "unknown ROS arguments '--log-levl', 'info'",
            marks=pytest.mark.nightly,
        ),
        (['--ros-args', '-p', 'keep:=-1.0'], "recorder: parameter 'keep' is -1.0"),
    ],
)
def test_words_that_nobody_would_hear_are_one_line_and_exit_code_2(tmp_path, args, words):
    code, _, errors = ended('recorder', *args, cwd=tmp_path)
    assert code == 2
    [line] = errors.splitlines()
    assert words in line
    assert not (tmp_path / 'bags').exists()


def test_words_behind_ros_args_are_not_the_programs():
    assert words_for_nobody(['-p', 'autostart:=false']) == ['-p', 'autostart:=false']
    assert words_for_nobody(['--ros-args', '-p', 'a:=1', '--', 'now', '--ros-args', 'x']) == ['now']


@pytest.mark.parametrize('named', [program.graph, *program.PROGRAMS.values()], ids=lambda p: p.name)
def test_every_program_leads_to_a_module_that_runs(named):
    assert getattr(program, named.name) == named
    module, _, what = named.runs.partition(':')
    assert callable(getattr(importlib.import_module(f'endoscope_nodes.{module}'), what))


def test_a_node_is_healthy_while_it_speaks(tmp_path):
    domain = {'ROS_DOMAIN_ID': str(private_domain())}
    bag = ['-p', f'bag:={tmp_path / "bag"}']
    process = start('recorder', '--ros-args', *bag, environment=domain)
    try:
        wait_for_line(process, 'recording to')
        heard = healthcheck('recorder', domain)
        silent = healthcheck('master', domain)
    finally:
        process.kill()
        process.communicate()
    assert (heard.returncode, heard.stderr) == (0, '')
    assert silent.returncode == 1
    assert silent.stderr == 'healthcheck: master has been silent for 5 s\n'


def healthcheck(node, environment):
    code = 'import sys; from endoscope_nodes.healthcheck import main; sys.exit(main())'
    return subprocess.run(
        [sys.executable, '-c', code, node],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize('composed', [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_one_process_of_all_nodes_or_of_each_in_motion_stops_cleanly(tmp_path, composed):
    with ProcessRig(100, composed, tmp_path, Random(1)) as rig:
        rig.begin('motion')
        assert rig.enable_and_move() is not None
        for k, (name, pid) in enumerate(zip(rig.names, rig.processes.pids, strict=True)):
            os.kill(pid, STOPPING[k % 2])
            [process] = [p for p in active_children() if p.pid == pid]
            process.join(PATIENCE_S)
            assert process.exitcode == 0, (tmp_path / f'{name}.log').read_text()
            assert 'Traceback' not in (tmp_path / f'{name}.log').read_text()
    assert (rig.bag / 'metadata.yaml').is_file()
