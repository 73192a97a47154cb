"""`endoscope console` as a person starts it, with its graph, and a node that looks on."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import ExitStack

from console_page import Page
from node_program import code_of
from operated_graph import OPERATED_RATE
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState, Joy

from endoscope_nodes.client.graph_client import joined_graph
from endoscope_nodes.client.graph_parameters import read_parameter, set_parameters
from endoscope_nodes.names import JOINTS, MASTER_CLUTCH, MOTOR_COMMAND, MOTORS, SLAVE_COMMAND
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import EVENT, profile
from endoscope_nodes.runtime.streams import JointReader
from endoscope_nodes.topics import Qos

CONSOLE = [sys.executable, '-m', 'endoscope_bringup.cli', 'console']
OF_THE_GRAPH = ['--ros-args', '-p', 'source:=master', '-p', f'tick_rate:={OPERATED_RATE}']
PATIENCE_S = 240.0
_QUEUE = profile(Qos(2000, reliable=False))


class Server:
    """The program, and its output so far."""

    def __init__(self, folder, environment, *words) -> None:
        self.lines = []
        self._news = threading.Condition()
        self.process = subprocess.Popen(
            [*CONSOLE, '--port', '0', *words],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        operate, look_on = (self.printed(words) for words in ('operate at', 'look on at'))
        self.address, _, self.token = operate.split()[-1].partition('/#token=')
        self.viewer_token = look_on.partition('#token=')[2].strip()

    def _read(self) -> None:
        for line in self.process.stdout:
            with self._news:
                self.lines.append(line)
                self._news.notify_all()

    def printed(self, words) -> str:
        """Wait for a line that begins with certain words."""

        def found():
            return next((line for line in self.lines if line.startswith(words)), '')

        with self._news:
            came = self._news.wait_for(
                lambda: found() or self.process.poll() is not None, PATIENCE_S
            )
        assert came, (words, self.lines)
        assert found(), (words, self.lines)
        return found()

    def end(self, number=signal.SIGINT) -> int:
        """End it by a signal; its status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        status = self.process.wait(PATIENCE_S)
        self._reader.join()
        return status


class ConsoleRig:
    """The program with its graph in simulated time, and a node that looks on.

    Attributes
    ----------
    server
        The program.
    client
        That node's side of the graph.
    goals, wanted
        Angles of the motors' commands and of the master's, as they came.
    clutches
        Messages of the clutch.
    """

    def __init__(self, folder, *words) -> None:
        self.folder = folder
        self.domain = private_domain()
        self.environment = os.environ | {'ROS_DOMAIN_ID': str(self.domain)}
        self._stack = ExitStack()
        self.goals, self.wanted, self.clutches = [], [], []
        self._graph = subprocess.Popen(
            [sys.executable, '-c', code_of('graph'), *OF_THE_GRAPH],
            cwd=folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=(folder / 'graph.log').open('w'),
        )
        self._stack.callback(self._end_graph)
        self._words = words
        try:
            self.server = self._serve()
            self._stack.callback(self._end)
            self.client = self._stack.enter_context(joined_graph('probe', 'endoscope', self.domain))
            self._listen(MOTOR_COMMAND, MOTORS, self.goals)
            self._listen(SLAVE_COMMAND, JOINTS, self.wanted)
            self.client.listen(
                Joy,
                MASTER_CLUTCH,
                lambda data, _: self.clutches.append(deserialize_message(data, Joy).buttons[0]),
                qos=EVENT,
            )
            self.server.printed('ready')
            self.until(lambda: self.client.state, 'the graph')
            self.until(lambda: len(self.client.heard_ns) >= 9, 'all nodes')
        except BaseException:
            self._stack.close()
            raise

    def _serve(self) -> Server:
        return Server(self.folder, self.environment, '--no-graph', *self._words)

    def _end_graph(self) -> None:
        self._graph.send_signal(signal.SIGINT)
        self._graph.wait(PATIENCE_S)

    def _end(self) -> None:
        # It may have been started anew.
        self.server.end()

    def _listen(self, topic, names, into) -> None:
        reader = JointReader(names)
        self.client.listen(
            JointState, topic, lambda data, _: into.append(reader.read(data).position), qos=_QUEUE
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stack.close()

    def page(self, **words) -> Page:
        """A page of the operator."""
        return Page(self.server.address, self.server.token, **words)

    def restart(self) -> None:
        """Start the program anew beside its graph."""
        self.server.end()
        self.server = self._serve()
        self.server.printed('ready')

    def until(self, condition, what='it') -> None:
        """Wait until something has come true."""
        assert self.client.wait_until(condition, PATIENCE_S), (
            f'{what} does not come; {self.client.state}: {self.client.why}'
        )

    def passes(self, seconds) -> None:
        """Let so much simulated time go on, by the commands of the motors or by the state."""
        self.client.wait_until(lambda: False, seconds)

    def stands(self) -> bool:
        """Let half a second go on; whether the goals of the motors stood still in it."""
        self.client.hear()
        self.goals.clear()
        self.passes(0.5)
        return all(max(angles) - min(angles) < 1e-9 for angles in zip(*self.goals, strict=True))

    def setting(self, name):
        return read_parameter(self.client, name).value

    def set(self, node, **values) -> None:
        set_parameters(self.client, node, values)

    def handle_senders(self) -> list[str]:
        """Who speaks for the clutch."""
        place = self.client.node.resolve_topic_name(MASTER_CLUTCH)
        return [i.node_name for i in self.client.node.get_publishers_info_by_topic(place)]


def ready(rig, page) -> None:
    """Take the controls, enable, and wait until a grip counts."""
    answer = page.order('claim', take=True)
    assert answer['ok'], (answer, rig.server.lines)
    if rig.client.state != 'ENABLED':
        command = 'resume' if rig.client.state == 'PAUSED' else 'enable'
        answer = page.order('state', command=command)
        assert answer['ok'], answer
    rig.until(lambda: page.dead_man == 'READY', 'READY')


def engage(rig, page, **hand) -> None:
    """Take hold, anew where a busy machine let go, until the slave follows."""
    end = time.monotonic() + PATIENCE_S
    while not (page.dead_man == 'ENGAGED' and page.state['dead_man']['following']):
        assert time.monotonic() < end, page.state
        if page.dead_man == 'READY':
            page.does(pressed=True, **hand)
        elif page.dead_man == 'OPEN' and page.hand.pressed:
            page.does(pressed=False, x=0.0, y=0.0)
        rig.passes(0.1)
