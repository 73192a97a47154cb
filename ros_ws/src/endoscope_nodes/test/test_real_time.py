"""Real-time scheduling as one option, or one line that names the permission that is missing."""

import os
import subprocess
import sys

import pytest

DOMAIN = 226
# Nodes at real-time priority print how their threads are scheduled, once they have begun to spin.
SHOW = f"""
import os, sys, threading
from pathlib import Path
from rclpy.context import Context
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.runtime import Runtime

class Example(EndoscopeNode):
    def __init__(self, runtime):
        super().__init__('example', runtime)
        self.ticker.add(lambda stamp, periods: self.ticker.ticks < 300 or runtime.stop())

try:
    with Runtime(['--ros-args', *sys.argv[1:]], Context(), {DOMAIN}) as runtime:
        idle = threading.Thread(target=threading.Event().wait, daemon=True)
        runtime.add(Example)
        runtime.prepare(whole_process=True)
        runtime.spin()
        idle.start()
        for task in Path('/proc/self/task').iterdir():
            thread = int(task.name)
            role = 'main' if thread == os.getpid() else (task / 'comm').read_text().strip()
            role = 'idle' if thread == idle.native_id else role
            policy, priority = os.sched_getscheduler(thread), os.sched_getparam(thread)
            print(role, policy, priority.sched_priority, *os.sched_getaffinity(thread))
except ParameterError as error:
    print(error, file=sys.stderr)
    sys.exit(2)
"""
# The limits that an administrator would set; raising them takes more than scheduling does.
GRANT = """
import resource
LIMITS = {resource.RLIMIT_RTPRIO: (30, 30), resource.RLIMIT_MEMLOCK: (-1, -1)}
resource.getrlimit = LIMITS.__getitem__
"""
FIFO, ON_FORK = os.SCHED_FIFO, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK


def run(*parameters, without=(), first=''):
    """Run the nodes after some code, without some capabilities where this user has any."""
    given = [word for parameter in parameters for word in ('-p', parameter)]
    drop = ','.join(f'-{name}' for name in without)
    setpriv = ['setpriv', f'--bounding-set={drop}', f'--inh-caps={drop}']
    return subprocess.run(
        [*(setpriv if drop and os.geteuid() == 0 else []), sys.executable, '-c', first + SHOW]
        + given,
        capture_output=True,
        text=True,
        check=False,
    )


def test_by_default_nothing_is_asked_of_the_kernel():
    done = run()
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    assert {row[0] for row in rows} >= {'main', 'idle', 'dds.ev.0'}
    assert {tuple(row[1:3]) for row in rows} == {(str(os.SCHED_OTHER), '0')}


def test_what_carries_messages_is_urgent_and_what_starts_later_is_not():
    done = run('realtime_priority:=7', f'cores:=[{min(os.sched_getaffinity(0))}]')
    if done.returncode == 2:
        assert "'memlock'" in done.stderr or "'rtprio'" in done.stderr
        pytest.skip('this user may set no real-time priority or lock no memory')
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    scheduled = {row[0]: (int(row[1]), int(row[2])) for row in rows}
    assert scheduled['main'] == (ON_FORK, 7)
    assert scheduled['idle'] == (os.SCHED_OTHER, 0)
    assert {scheduled[name] for name in scheduled if name.startswith('dds.')} == {(FIFO, 7)}
    assert {tuple(row[3:]) for row in rows} == {(str(min(os.sched_getaffinity(0))),)}


@pytest.mark.nightly
def test_what_the_limits_of_a_user_grant_is_taken_unasked_in_real_time_only():
    done = run('realtime_priority:=30')
    if done.returncode == 2:
        pytest.skip('this user may set no real-time priority or lock no memory')
    done = run(first=GRANT)
    assert done.returncode == 0, done.stderr
    assert f'main {ON_FORK} 30' in done.stdout
    assert 'real-time priority 30 is taken' in done.stdout + done.stderr
    assert f'main {ON_FORK}' not in run('realtime_priority:=0', first=GRANT).stdout


@pytest.mark.parametrize(
    ('parameters', 'without', 'words'),
    [
        (['realtime_priority:=7'], ('sys_nice', 'ipc_lock'), "'realtime_priority' is 7, for which"),
        (
            ['realtime_priority:=7', 'use_sim_time:=true'],
            (),
            'not for simulated time; give 0, or to `graph` --real-time',
        ),
        (['cores:=[4095]'], (), "'cores' is [4095]; this process may use [0"),
    ],
)
def test_what_cannot_be_had_is_refused_in_one_line(parameters, without, words):
    done = run(*parameters, without=without)
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert words in line
