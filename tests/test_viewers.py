"""What Foxglove and Lichtblick see of a graph, by a client that speaks their protocol."""

import importlib
import json
import socket
import struct
import sys
import time
from contextlib import contextmanager

import pytest
from simulated_graph import SimulatedGraph
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from endoscope_bags.message_types import STRING, message_type, typestore
from endoscope_console.viewers import viewers
from endoscope_core.errors import EndoscopeError
from endoscope_core.kinematics import robot_description
from endoscope_core.rig import shipped_rig
from endoscope_nodes.graph import SHOWING_NODES
from endoscope_nodes.nodes.instrument_model import section_of
from endoscope_nodes.topics import RECORDED

pytestmark = pytest.mark.nightly

PROTOCOL = 'foxglove.sdk.v1'
MESSAGE_DATA = 1
DESCRIPTION = '/robot_description'
PATIENCE_S = 120.0
_HEAD = struct.Struct('<BIQ')
INSTRUMENT = shipped_rig().instrument


class Viewer:
    """A client of the SDK's subprotocol that asks for topics and keeps what comes."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.info: dict = {}
        self.channels: dict[str, dict] = {}
        self.messages: dict[str, list[bytes]] = {}
        self._topics: list[str] = []

    def hear(self) -> None:
        """Take what has come until now."""
        while True:
            try:
                data = self.socket.recv(timeout=0.02)
            except TimeoutError:
                return
            if isinstance(data, bytes):
                kind, subscription, _ = _HEAD.unpack_from(data)
                if kind == MESSAGE_DATA:
                    self.messages[self._topics[subscription]].append(data[_HEAD.size :])
                continue
            said = json.loads(data)
            if said['op'] == 'serverInfo':
                self.info = said
            if said['op'] == 'advertise':
                self.channels |= {channel['topic']: channel for channel in said['channels']}

    def subscribe(self, *topics: str) -> None:
        """Ask for topics."""
        asked = []
        for topic in topics:
            asked.append({'id': len(self._topics), 'channelId': self.channels[topic]['id']})
            self._topics.append(topic)
            self.messages[topic] = []
        self.socket.send(json.dumps({'op': 'subscribe', 'subscriptions': asked}))

    def decoded(self, topic: str) -> list:
        """Messages of a topic, by what was announced of it."""
        kind = self.channels[topic]['schemaName']
        return [typestore().deserialize_cdr(data, kind) for data in self.messages[topic]]


@pytest.fixture(scope='module')
def graph():
    with SimulatedGraph(extra=SHOWING_NODES) as graph:
        graph.enable()
        graph.set('master', source='motion', motion='non_periodic')
        yield graph


@pytest.fixture
def address(graph, monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(graph.domain))
    with viewers('endoscope', 0) as address:
        yield address


@contextmanager
def viewing(address):
    """A viewer, for as long as the block lasts."""
    with connect(address, subprotocols=[PROTOCOL], max_size=None, max_queue=None) as socket:
        yield Viewer(socket)


def wait(graph, viewer, condition) -> None:
    """Let simulated time go on until the viewer has seen something."""
    until = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until, {t: len(m) for t, m in viewer.messages.items()}
        graph.advance(0.05)
        viewer.hear()


def test_a_viewer_sees_the_graph(graph, address):
    topics = [name if name.startswith('/') else f'/endoscope/{name}' for name in RECORDED]
    streams = ('/tf', '/endoscope/joint_states', '/endoscope/motor/servo_jp')
    streams += ('/endoscope/wires/measured_js', '/diagnostics')
    with viewing(address) as viewer:
        wait(graph, viewer, lambda: set(topics) <= set(viewer.channels))
        assert set(viewer.channels) == set(topics)
        for channel in viewer.channels.values():
            assert channel['encoding'] == 'cdr'
            assert channel['schemaEncoding'] == 'ros2msg'
            assert channel['schema'] == message_type(channel['schemaName']).definition
        viewer.subscribe(DESCRIPTION, *streams)
        wait(graph, viewer, lambda: all(len(viewer.messages[topic]) > 3 for topic in streams))
        # It may come twice: latched for whoever subscribes, and passed on at that moment.
        description = viewer.decoded(DESCRIPTION)[0]
        assert description.data == robot_description(section_of(INSTRUMENT))
        for message in viewer.decoded('/tf'):
            assert message.transforms[-1].child_frame_id == 'endoscope_tip'
        assert all(len(m.effort) == 4 for m in viewer.decoded('/endoscope/wires/measured_js'))
        with viewing(address) as late:
            wait(graph, late, lambda: DESCRIPTION in late.channels)
            late.subscribe(DESCRIPTION)
            wait(graph, late, lambda: late.messages[DESCRIPTION])


def test_a_stream_comes_a_hundred_times_a_second_at_most(graph, address):
    stream = '/endoscope/motor/measured_js'
    with viewing(address) as viewer:
        wait(graph, viewer, lambda: stream in viewer.channels)
        begun = time.monotonic()
        viewer.subscribe(stream)
        wait(graph, viewer, lambda: len(viewer.messages[stream]) > 20)
        assert len(viewer.messages[stream]) <= (time.monotonic() - begun) / 0.01 + 1


def test_a_viewer_can_only_read(graph, address):
    command = '/endoscope/slave/state_command'
    channel = {'id': 7, 'topic': command, 'encoding': 'cdr', 'schemaName': STRING}
    text = bytes(typestore().serialize_cdr(typestore().types[STRING](data='disable'), STRING))
    with viewing(address) as viewer:
        wait(graph, viewer, lambda: bool(viewer.info) and bool(viewer.channels))
        assert viewer.info['capabilities'] == []
        viewer.socket.send(json.dumps({'op': 'advertise', 'channels': [channel]}))
        viewer.socket.send(struct.pack('<BI', 1, 7) + text)
        graph.advance(0.5)
        viewer.hear()
        assert graph.state == 'ENABLED'


def test_only_this_machine_reaches_it_and_only_by_its_protocol_and_a_port_is_one_servers(address):
    port = int(address.rpartition(':')[2])
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(('127.0.0.2', port), timeout=5.0)
    with pytest.raises(InvalidStatus), connect(address):
        pass
    with (
        pytest.raises(EndoscopeError, match=f'{port}.*--viewers-port'),
        viewers('endoscope', port),
    ):
        pass


def test_without_the_sdk_one_line_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, 'foxglove', None)
    monkeypatch.delitem(sys.modules, 'endoscope_console.viewers')
    with pytest.raises(EndoscopeError, match='`make -C ros_ws viewers` installs it'):
        importlib.import_module('endoscope_console.viewers')
