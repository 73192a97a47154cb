"""`endoscope console` with its graph, as a person starts it, and the commands to its motors."""

import math
import os
import signal
import subprocess
import sys
import time
from bisect import bisect_right
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState, Joy

from endoscope_core.errors import EndoscopeError
from endoscope_core.exit_status import ClosedOnExit
from endoscope_nodes.client.graph_client import joined_graph
from endoscope_nodes.names import JOINTS, MASTER_CLUTCH, MASTER_MEASURED, MOTOR_COMMAND, MOTORS
from endoscope_nodes.runtime.qos import EVENT, profile
from endoscope_nodes.runtime.streams import JointReader
from endoscope_nodes.topics import Qos

PAGE_PATIENCE_S = 150.0
SAME_RAD = 1e-9
"""Angles that differ by less are the same."""
_COMMAND = (sys.executable, '-m', 'endoscope_bringup.cli', 'console', '--port', '0')
_DEEP = profile(Qos(20_000, reliable=False))


class ConsoleError(EndoscopeError, RuntimeError):
    """The program does not start, or a condition times out."""


class Heard:
    """Angles of a topic's J joints or motors in the order of reception."""

    def __init__(self, names: Sequence[str]) -> None:
        self._reader = JointReader(names)
        self.at_ns: list[int] = []  # when each message was received, ns since the epoch
        self.angles: list[tuple[float, ...]] = []  # rad, each of shape (J,)

    def take(self, data: bytes, received_ns: int) -> None:
        self.angles.append(self._reader.read(data).position)
        self.at_ns.append(received_ns)

    def forget(self) -> None:
        del self.at_ns[:-1], self.angles[:-1]

    def changes_ns(self) -> NDArray[np.int64]:
        """Times of reception of changed angles, ns since the epoch, shape (N,)."""
        if len(self.angles) < 2:
            return np.empty(0, dtype=np.int64)
        steps = np.abs(np.diff(self.angles, axis=0)).max(axis=1)
        return np.asarray(self.at_ns[1:], dtype=np.int64)[steps > SAME_RAD]

    def first_change_ms(self, since_ns: int) -> float:
        """Time in ms from a time in ns to the first change of angles; NaN if there was none."""
        changes = self.changes_ns()
        after = changes[changes > since_ns]
        return (int(after[0]) - since_ns) * 1e-6 if after.size else math.nan

    def travel_since(self, since_ns: int) -> float:
        """Largest distance in rad of an angle from the one in force at a time in ns."""
        first = max(0, bisect_right(self.at_ns, since_ns) - 1)
        if not self.angles:
            return 0.0
        return float(np.abs(np.subtract(self.angles[first:], self.angles[first])).max())


class ServedConsole(ClosedOnExit):
    """The program, started in a folder, with origins of relays allowed; and a subscriber."""

    def __init__(
        self,
        folder: Path,
        domain: int,
        origins: tuple[str, ...] = (),
        *,
        real_time: bool = False,
        graph: str = '',
    ) -> None:
        words = [f'--origin={origin}' for origin in origins] + [f'--graph={graph}']
        words += ['--real-time'] if real_time else []
        self.log = folder / 'console.log'
        with self.log.open('w') as log:
            self._process = subprocess.Popen(
                [*_COMMAND, *words],
                cwd=folder,
                env=os.environ | {'ROS_DOMAIN_ID': str(domain)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )
        # Measured angles of the handle, and commanded angles of the motors.
        self.handle, self.motors = Heard(JOINTS), Heard(MOTORS)
        self.clutches: list[tuple[int, bool]] = []  # time of reception, and whether it was held
        self._stack = ExitStack()
        self._stack.callback(self._end)
        try:
            self._await_graph()
            # Only now: another node in the namespace would look like a graph that answers.
            self.client = self._stack.enter_context(joined_graph('looker_on', 'endoscope', domain))
            for topic, heard in ((MASTER_MEASURED, self.handle), (MOTOR_COMMAND, self.motors)):
                self.client.listen(JointState, topic, heard.take, qos=_DEEP)
            self.client.listen(Joy, MASTER_CLUTCH, self._on_clutch, qos=EVENT)
            operate = self.log.read_text().splitlines()[0]
            self.address, _, self.token = operate.split()[-1].partition('/#token=')
            self.until(lambda: len(self.client.heard_ns) >= 9, 'all nodes')
        except BaseException:
            self.close()
            raise

    def _await_graph(self) -> None:
        end = time.monotonic() + PAGE_PATIENCE_S
        while 'ready ' not in self.log.read_text():
            if time.monotonic() > end or self._process.poll() is not None:
                raise ConsoleError(f'the console does not start: {self.log.read_text()[-2000:]}')
            time.sleep(0.1)

    @property
    def port(self) -> int:
        return int(self.address.rpartition(':')[2])

    def _on_clutch(self, data: bytes, received_ns: int) -> None:
        self.clutches.append((received_ns, deserialize_message(data, Joy).buttons[0] == 1))

    def forget(self) -> None:
        """Forget all samples except the latest ones."""
        self.client.hear()
        self.handle.forget()
        self.motors.forget()
        del self.clutches[:-1]

    def passes(self, seconds: float) -> None:
        self.client.wait_until(lambda: False, seconds)

    def until(
        self, condition: Callable[[], bool], what: str, patience_s: float = PAGE_PATIENCE_S
    ) -> None:
        """Listen until a condition holds; ConsoleError on a timeout or if the program has ended."""
        end = time.monotonic() + patience_s
        while not self.client.wait_until(condition, 0.5):
            if time.monotonic() > end or self._process.poll() is not None:
                raise ConsoleError(
                    f'timed out waiting for {what}; {self.client.state} {self.client.why}; log of '
                    f'the console: {self.log.read_text()[-2000:]}'
                )

    def released_ns(self, since_ns: int) -> int | None:
        """Time of the first message of a free clutch after a time; None if there was none."""
        return next((at for at, held in self.clutches if at >= since_ns and not held), None)

    def _end(self) -> None:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(PAGE_PATIENCE_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def close(self) -> None:
        """End program and graph, as Ctrl-C does."""
        self._stack.close()
