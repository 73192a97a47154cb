"""Message rate that the recorder sustains, and its CPU time."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import rclpy
from rclpy.context import Context
from sensor_msgs.msg import JointState

from endoscope_bags import open_bag
from endoscope_bags.cdr import encode_joint_state
from endoscope_lab.bench import cpu_seconds
from endoscope_nodes.runtime.environment import stay_on_this_machine
from endoscope_nodes.runtime.qos import SENSOR_OFFERED

RATES = (5_000, 10_000, 20_000)
"""Messages per second; the last is the target."""
TARGET_CPU_SHARE = 0.5
_TOPICS = 20
_STEP_S = 0.001
_MATCHING_TIMEOUT_S = 20.0


def run(seconds: float) -> int:
    """Print a line for each rate; return 1 if the target is missed."""
    return 0 if [_keeps_up(rate, seconds) for rate in RATES][-1] else 1


def _keeps_up(rate: int, seconds: float) -> bool:
    """Send messages at a rate in 1/s to a recorder process, print; whether the target is met."""
    topics = [f'/bench_{os.getpid()}/topic_{k}' for k in range(_TOPICS)]
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'bag'
        with _Sender(topics) as sender:
            command = [sys.executable, '-m', 'endoscope_bringup.cli', 'record', '--out', str(bag)]
            recorder = subprocess.Popen(
                [*command, '--topics', *topics], stderr=subprocess.PIPE, text=True
            )
            try:
                sender.wait_for_readers()
                cpu_before, began = cpu_seconds(recorder.pid), time.monotonic()
                sent = sender.send(rate, seconds)
                # One second more, so that the CPU time includes all queued messages.
                elapsed = time.monotonic() - began
                time.sleep(1.0)
                cpu = cpu_seconds(recorder.pid) - cpu_before
            finally:
                recorder.terminate()
                _, errors = recorder.communicate(timeout=30)
        if not bag.exists():
            raise RuntimeError(f'the recorder failed: {errors}')
        recorded = open_bag(bag).message_count
    print(
        f'{rate:>8} /s wanted  {sent / elapsed:>8.0f} /s sent  '
        f'{sent - recorded:>7} of {sent} lost  {100 * cpu / elapsed:>5.1f} % of a core',
        flush=True,
    )
    return recorded == sent and cpu / elapsed <= TARGET_CPU_SHARE


class _Sender:
    """Publishes prepared messages in steps of a millisecond."""

    def __init__(self, topics: Sequence[str]) -> None:
        self._context = Context()
        stay_on_this_machine()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node('bench_sender', context=self._context)
        self._publishers = [
            self._node.create_publisher(JointState, topic, SENSOR_OFFERED) for topic in topics
        ]
        self._message = encode_joint_state(
            ['bend_x', 'bend_y'], time.time_ns(), position=[0.1, 0.2], velocity=[0.3, 0.4]
        )

    def wait_for_readers(self) -> None:
        deadline = time.monotonic() + _MATCHING_TIMEOUT_S
        while not all(p.get_subscription_count() for p in self._publishers):
            if time.monotonic() > deadline:
                raise RuntimeError('the recorder did not find the topics')
            time.sleep(0.05)
        # The writer knows the reader now, but the reader may not know the writer yet.
        time.sleep(1.0)

    def send(self, rate: int, seconds: float) -> int:
        began = time.monotonic()
        sent = 0
        message, publishers = self._message, self._publishers
        while (elapsed := time.monotonic() - began) < seconds:
            due = int(elapsed * rate)
            # A delayed sender does not catch up in one burst, as a bus does not either.
            for k in range(sent, min(due, sent + rate // 100)):
                publishers[k % _TOPICS].publish(message)
                sent += 1
            time.sleep(_STEP_S)
        return sent

    def __enter__(self) -> '_Sender':
        return self

    def __exit__(self, *_: object) -> None:
        self._node.destroy_node()
        self._context.shutdown()
