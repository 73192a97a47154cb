"""The simulated graph, and programs beside it that operate it from a shell or a terminal."""

import os
import pty
import re
import subprocess
import sys
import termios
import time

from simulated_graph import SimulatedGraph

from endoscope_nodes.names import JOINTS, MOTOR_COMMAND, MOTORS, SLAVE_COMMAND
from endoscope_nodes.recorder_node import RecorderNode

ENDOSCOPE = [sys.executable, '-m', 'endoscope_bringup.cli']
# A shell does this for the programs that it starts.
_TAKE_TERMINAL = """
import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""
_STEP_S = 0.02
_LONGEST_S = 300.0


class OperatedGraph(SimulatedGraph):
    """The whole graph, recorder included, no faster than real time while a program is at it."""

    def __init__(self, folder, **values) -> None:
        overrides = {'recorder': {'bag': str(folder / 'bag'), 'autostart': False}}
        overrides |= {
            'calibration': {'motion': 'brief'},
            'conductor': {'wait_for': ['motor/measured_js']},
        }
        super().__init__(extra=(RecorderNode,), overrides=overrides | values)
        self.goals = self.listen(MOTOR_COMMAND, MOTORS)
        self.wanted = self.listen(SLAVE_COMMAND, JOINTS)
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
            [*ENDOSCOPE, *words],
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def finish(self, process) -> tuple[int, str, str]:
        """Exit status, stdout and stderr of a program that ends while the graph goes on."""
        try:
            self.until(lambda: process.poll() is not None, ' '.join(process.args[3:]))
            return (process.returncode, *process.communicate())
        finally:
            process.kill()
            process.communicate()

    def run(self, *words) -> tuple[int, str, str]:
        return self.finish(self.start(*words, '--timeout', '60'))


class Typist:
    """`endoscope teleop` in a pseudo-terminal, and the one who types there.

    Parameters
    ----------
    kitty
        Whether the terminal speaks kitty's keyboard protocol.
    """

    def __init__(self, graph, *words, kitty=False, command=None) -> None:
        self.graph = graph
        self.goals, self.wanted = graph.goals, graph.wanted
        self.goals.clear()
        self.wanted.clear()
        self.screen = b''
        self._answer = b'\x1b[?0u\x1b[?62c' if kitty else b'\x1b[?62c'
        self._answered = 0
        self.master, slave = pty.openpty()
        self.before = termios.tcgetattr(slave)
        self.slave = slave
        teleop = [*ENDOSCOPE, 'teleop', *words, '--timeout', '60']
        self.process = subprocess.Popen(
            [sys.executable, '-c', _TAKE_TERMINAL, *(command or teleop)],
            env=graph.environment | {'TERM': 'xterm'},
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
        )
        os.set_blocking(self.master, False)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        for end in (self.master, self.slave):
            if end is not None:
                os.close(end)

    def read(self) -> None:
        """Take what the program wrote, and answer as the terminal does."""
        if self.master is None:
            return
        try:
            while data := os.read(self.master, 65536):
                self.screen += data
        except OSError:
            pass
        for _ in range(self.screen.count(b'\x1b[?u\x1b[c') - self._answered):
            self._answered += 1
            self.type(self._answer)

    def type(self, data: bytes) -> None:
        os.write(self.master, data)

    @property
    def line(self) -> str:
        """The line that shows what goes on."""
        text = self.screen.decode(errors='replace')
        return text.rpartition('\r\x1b[K')[2]

    @property
    def text(self) -> str:
        return re.sub(r'\x1b\[[0-9;?<>]*[a-zA-Z]', '', self.screen.decode(errors='replace'))

    def until(self, condition, what='it') -> None:
        def read_and_look():
            self.read()
            return condition()

        self.graph.until(read_and_look, f'{what} ({self.text[-400:]!r})')

    def shows(self, words: str) -> None:
        self.until(lambda: words in self.line, words)

    def enable(self) -> None:
        self.shows('DISABLED')
        self.type(b'e')
        self.shows('ENABLED')

    def hold(self, key: bytes, condition, what='motion') -> None:
        """Hold a key until something has come true: 0.4 s, then 30 repeats a second."""
        self.type(key)
        due = time.monotonic() + 0.4

        def repeat():
            nonlocal due
            self.read()
            if time.monotonic() >= due:
                due = time.monotonic() + 1.0 / 30.0
                self.type(key)
            return condition()

        self.graph.until(repeat, f'{what} ({self.text[-400:]!r})')

    def stands(self) -> bool:
        """Let half a second go on; whether the goals of the motors stood still in it."""
        begin = self.graph.conductor.now_ns
        self.until(lambda: self.graph.conductor.now_ns > begin + 500_000_000)
        return all(
            abs(a - b) < 1e-9
            for goal in [g for g in self.goals if g.stamp_ns > begin]
            for a, b in zip(goal.position, self.goals[-1].position, strict=True)
        )

    def end(self) -> int:
        """Wait for the program to end; its status."""
        self.until(lambda: self.process.poll() is not None, 'the end')
        self.read()
        return self.process.returncode

    def hang_up(self) -> None:
        """Close the terminal, as closing its window does."""
        os.close(self.master)
        os.close(self.slave)
        self.master = self.slave = None
