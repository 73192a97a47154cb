"""The simulated graph, and programs beside it that operate it from a shell or a terminal."""

import fcntl
import io
import os
import pty
import struct
import subprocess
import sys
import termios
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout, suppress
from unittest.mock import patch

import numpy as np
from sensor_msgs.msg import Joy
from simulated_graph import SimulatedGraph

from endoscope_bringup.cli import main
from endoscope_nodes.names import JOINTS, MASTER_CLUTCH, MOTOR_COMMAND, MOTORS, SLAVE_COMMAND
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.runtime.qos import EVENT

ENDOSCOPE = [sys.executable, '-m', 'endoscope_bringup.cli']
# A shell does this for the programs that it starts.
_TAKE_TERMINAL = """
import fcntl, os, signal, sys, termios
signal.signal(signal.SIGHUP, signal.SIG_DFL)
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""
# Tests in the background of a shell ignore SIGINT, under nohup SIGHUP, and so would their programs.
_HEAR_INTERRUPTS = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""
OPERATED_RATE = 100
"""Hz: as many as what a program shows of a graph, and does to it, needs."""
_STEP_S = 0.02
_LONGEST_S = 60.0
_TIMES, _AGAIN_S = 6, 5.0
# A keyboard's delay and rate. On a machine that runs nothing in time a hold ends and is begun anew.
_DELAY_S, _PERIOD_S, _LONGEST_HOLD_S = 0.4, 1.0 / 30.0, 6.0


class OperatedGraph(SimulatedGraph):
    """The whole graph, recorder included, no faster than real time while a program is at it."""

    def __init__(self, folder, extra=(), tick_rate=OPERATED_RATE, **values) -> None:
        overrides = {'recorder': {'bag': str(folder / 'bag'), 'autostart': False}}
        overrides |= {
            'calibration': {'motion': 'brief'},
            'simulation_clock': {'wait_for': ['motor/measured_js']},
        }
        super().__init__(
            extra=(*extra, RecorderNode), overrides=overrides | values, tick_rate=tick_rate
        )
        self.goals = self.listen(MOTOR_COMMAND, MOTORS)
        self.wanted = self.listen(SLAVE_COMMAND, JOINTS)
        self.clutches: list[int] = []
        self.probe.create_subscription(
            Joy, MASTER_CLUTCH, lambda m: self.clutches.append(m.buttons[0]), EVENT
        )
        self.advance(0.1)
        self._due = time.monotonic()

    @staticmethod
    def environment_of(domain: int) -> dict[str, str]:
        return os.environ | {'ROS_DOMAIN_ID': str(domain)}

    @property
    def environment(self) -> dict[str, str]:
        return self.environment_of(self.domain)

    def pace(self) -> None:
        """Let some time go on, in no less than that."""
        self.advance(_STEP_S)
        now = time.monotonic()
        self._due = max(self._due + _STEP_S, now)
        time.sleep(self._due - now)

    def until(self, condition, what='it') -> None:
        """Let time go on until something has come true."""
        end = time.monotonic() + _LONGEST_S
        while not condition():
            assert time.monotonic() < end, f'{what} does not come: {self.situation()}'
            self.pace()

    def start(self, *words) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, '-c', _HEAR_INTERRUPTS, *ENDOSCOPE, *words],
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def finish(self, process) -> tuple[int, str, str]:
        """Exit status, stdout and stderr of a program that ends while the graph goes on."""
        try:
            self.until(lambda: process.poll() is not None, ' '.join(process.args[6:]))
            return (process.returncode, *process.communicate())
        finally:
            process.kill()
            process.communicate()

    def run(self, *words, timeout=60) -> tuple[int, str, str]:
        """Exit status, stdout and stderr of a command in this process, while the graph goes on."""
        out, errors, over = io.StringIO(), io.StringIO(), threading.Event()

        def live() -> None:
            while not over.is_set():
                self.pace()

        with (
            patch.dict(os.environ, self.environment),
            redirect_stdout(out),
            redirect_stderr(errors),
            ThreadPoolExecutor(1) as thread,
        ):
            living = thread.submit(live)
            try:
                status = main([*words, '--timeout', str(timeout)])
            finally:
                over.set()
        living.result()
        return status, out.getvalue(), errors.getvalue()


class Typist:
    """`endoscope teleop` in a pseudo-terminal, and the one who types there.

    A thread of its own types as a keyboard does, however slow the graph is.
    """

    def __init__(self, graph, *words) -> None:
        self.graph = graph
        self.goals, self.wanted = graph.goals, graph.wanted
        self.goals.clear()
        self.wanted.clear()
        self.screen = b''
        self._held = b''
        self._longest_s = _LONGEST_HOLD_S
        self._open = True
        self.master, self.slave = pty.openpty()
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack('4H', 24, 80, 0, 0))
        self.before = termios.tcgetattr(self.slave)
        teleop = [*ENDOSCOPE, 'teleop', *words, '--timeout', '60']
        self.process = subprocess.Popen(
            [sys.executable, '-c', _TAKE_TERMINAL, *teleop],
            env=graph.environment | {'TERM': 'xterm'},
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            start_new_session=True,
        )
        os.set_blocking(self.master, False)
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        """End it as its user would; one that is killed stays in the graph for a while."""
        self.process.terminate()
        try:
            self.end()
        finally:
            self.process.kill()
            self.process.wait()
            self.hang_up()

    def _live(self) -> None:
        """Read, and have a held key repeat, as terminal and keyboard do."""
        typing, due, until = b'', 0.0, 0.0
        while self._open:
            self._read()
            now = time.monotonic()
            if typing and (typing != self._held or now > until):
                typing = b''
                time.sleep(0.3)
            elif self._held and not typing:
                typing = self._held
                self.type(typing)
                due, until = now + _DELAY_S, now + self._longest_s
            elif typing and now >= due:
                due = now + _PERIOD_S
                self.type(typing)
            time.sleep(0.005)

    def _read(self) -> None:
        with suppress(OSError):
            while data := os.read(self.master, 65536):
                self.screen += data

    def type(self, data: bytes) -> None:
        os.write(self.master, data)

    @property
    def line(self) -> str:
        """The last line."""
        return self.text.rstrip().rpartition('\n')[2]

    @property
    def text(self) -> str:
        return self.screen.decode(errors='replace')

    def until(self, condition, what='it') -> None:
        try:
            self.graph.until(condition, what)
        except AssertionError as error:
            raise AssertionError(f'{error}; the terminal shows {self.text[-400:]!r}') from None

    def shows(self, words: str) -> None:
        self.until(lambda: words in self.line, words)

    def enable(self) -> None:
        """Press E, again where the graph has not heard of this program yet."""
        self.shows('DISABLED')
        for _ in range(_TIMES):
            self.type(b'e')
            again = time.monotonic() + _AGAIN_S
            self.until(lambda at=again: 'ENABLED' in self.line or time.monotonic() > at)
            if 'ENABLED' in self.line:
                return
        raise AssertionError(f'E enables nothing: {self.line!r}')

    def hold(self, key: bytes, until, what='motion', longest_s=_LONGEST_HOLD_S) -> None:
        """Hold a key until something has come true; press it anew where that has ended."""
        self._longest_s = longest_s
        self._held = key
        try:
            self.until(until, what)
        finally:
            self._held = b''

    def stands(self) -> bool:
        """Let half a second go on; whether the goals of the motors stood still in it."""
        begin = self.graph.clock.now_ns
        self.until(lambda: self.graph.clock.now_ns > begin + 500_000_000)
        goals = [goal.position for goal in self.goals if goal.stamp_ns > begin]
        return not goals or bool(np.ptp(goals, axis=0).max() < 1e-9)

    def end(self) -> int:
        """Wait for the program to end; its status."""
        self.until(lambda: self.process.poll() is not None, 'the end')
        self._read()
        return self.process.returncode

    def hang_up(self) -> None:
        """Close the terminal, as closing its window does."""
        if self._open:
            self._open = False
            self._thread.join()
            os.close(self.master)
            os.close(self.slave)
            self.slave = None
