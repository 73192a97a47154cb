"""The server of the console, operated by pages without a browser and attacked by some."""

import json
import os
import random
import signal
import socket
import time
from contextlib import ExitStack, closing, suppress

import numpy as np
import pytest
from console_page import Page
from console_rig import ConsoleRig, Server, engage, ready
from diagnostic_msgs.msg import DiagnosticArray
from operated_graph import OPERATED_RATE
from page_frames import encode_input
from rclpy.serialization import deserialize_message
from security_policy import NAMESPACE, allowed
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from endoscope_console.clients import FRAMES_A_SECOND, UNANSWERED
from endoscope_console.teleop.frames import InputFrame
from endoscope_nodes.client.graph_client import joined_graph
from endoscope_nodes.client.handle_sender import HandleSender
from endoscope_nodes.names import CONSOLE_LOG
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import EVENT
from endoscope_nodes.topics import RECORDED

FAR = 0.06
UNITS = [*['rad'] * 8, *['N'] * 10, '', 'rad', 'rad']
BUSY = ('silent', 'late', 'stalled', 'blind')
_PATIENCE_S = 60.0
_TEN_MEGABYTES = 10_000_000
_FRAME = InputFrame(False, False, True, True, False, 0, 1, 0, 0, 0.0, 0.0, 0.0)


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    folder = tmp_path_factory.mktemp('console')
    with ConsoleRig(folder) as rig:
        rig.orders = []
        rig.client.listen(DiagnosticArray, CONSOLE_LOG, lambda data, _: note(rig, data), qos=EVENT)
        yield rig


def note(rig, data):
    (status,) = deserialize_message(data, DiagnosticArray).status
    rig.orders.append({item.key: item.value for item in status.values})


@pytest.fixture
def rig(running):
    # The one before has left the handle's place. One that failed may have left a source behind.
    if running.server.process.poll() is not None:
        running.restart()
    own = 'console_web'
    running.until(lambda: own not in running.handle_senders(), 'a free place of the handle')
    running.set('master', source='master')
    running.until(lambda: not running.handle_senders(), 'nobody else in it')
    if running.client.state != 'DISABLED':
        running.client.ask('disable')
    running.clutches.clear()
    running.wanted.clear()
    running.orders.clear()
    return running


def moved(rig):
    """How far each joint was asked to go since it was first asked, rad."""
    return np.subtract(rig.wanted[-1], rig.wanted[0]) if rig.wanted else np.zeros(2)


def follows(rig, page):
    """Have the slave follow a hand that asks for bend_x."""
    ready(rig, page)
    rig.wanted.clear()
    while abs(moved(rig)[0]) < FAR:
        engage(rig, page, x=0.6)
        rig.passes(0.1)


def ended(rig, page, act, *reasons):
    """Have the slave follow, and do what ends that; anew where a busy machine was quicker."""
    while True:
        follows(rig, page)
        act()
        stopped(rig, page)
        reason = page.state['dead_man']['reason']
        if reason not in BUSY or reason in reasons:
            assert reason in reasons
            return
        page.sends = True
        page.does(pressed=False, x=0.0, visible=True, focused=True)


def stopped(rig, page):
    rig.until(lambda: page.dead_man != 'ENGAGED', 'the release')
    rig.until(lambda: rig.clutches and rig.clutches[-1] == 0, 'clutch 0')
    assert rig.stands()


def test_a_held_hand_moves_the_slave_and_its_release_stops_it(rig):
    with rig.page() as page:
        assert page.hello['role'] == 'operator'
        assert [s['unit'] for s in page.hello['signals']] == UNITS
        ended(rig, page, lambda: page.does(pressed=False, x=0.0), 'released')
        assert abs(moved(rig)[1]) < 0.01
        assert 1 in rig.clutches
        wanted = page.picture.ranges[0]
        assert np.isnan(wanted).all()
        assert np.isfinite(page.picture.actual).all()


def test_the_server_hears_what_the_policy_lets_it_hear(rig):
    heard = rig.client.node.get_subscriber_names_and_types_by_node('console_web', NAMESPACE)
    assert heard
    assert {topic for topic, _ in heard} <= allowed()['console_web']['subscribe']


def test_somebody_speaks_for_the_handle_only_while_he_operates_and_leaves_the_source_as_it_was(rig):
    rig.set('master', source='none')
    try:
        with rig.page() as page:
            assert rig.handle_senders() == []
            assert page.order('claim')['ok']
            assert rig.setting('master.source') == 'master'
            rig.until(lambda: rig.handle_senders() == ['console_web'], 'the sender')
            assert page.order('release')['ok']
            rig.until(lambda: rig.handle_senders() == [], 'the end of it')
            rig.until(lambda: rig.setting('master.source') == 'none', 'the source')
            # What is played is ended only on demand, and does not begin anew.
            rig.set('master', source='motion')
            rig.until(lambda: page.state.get('playing') is not None, 'the motion')
            assert 'the master plays' in page.order('claim')['why']
            ready(rig, page)
            assert rig.setting('master.source') == 'master'
            page.order('release')
            rig.until(lambda: rig.setting('master.source') == 'motion', 'the source')
            rig.until(lambda: rig.client.state == 'PAUSED', 'PAUSED')
    finally:
        rig.set('master', source='master')


def test_silence_of_the_page_ends_the_grip_and_then_the_lease(rig):
    with rig.page() as page:
        ended(rig, page, lambda: setattr(page, 'sends', False), 'silent', 'stalled')
        rig.until(lambda: page.lost, 'the end of the lease')
        assert 'silent' in page.lost[0]['why']
        rig.until(lambda: page.state['lease']['holder'] == '', 'a state without a lease')
        # A page that wakes up has to ask anew.
        page.sends = True
        rig.passes(0.3)
        assert page.state['lease']['holder'] == ''
        assert rig.stands()


def test_a_viewer_looks_on(rig):
    with Page(rig.server.address, rig.server.viewer_token) as page:
        assert page.hello['role'] == 'viewer'
        for order, fields in (
            ('claim', {'take': True}),
            ('state', {'command': 'enable'}),
            ('bags', {}),
        ):
            refused = page.order(order, **fields)
            assert not refused['ok']
            assert 'viewer' in refused['why']
        with rig.page() as other:
            other.order('claim')
            rig.until(lambda: any(one['operator'] == other.you for one in rig.orders))
        assert not any(one['operator'] == page.you for one in rig.orders), 'it fills no recording'
        rig.until(lambda: page.pictures > 3)
        assert rig.client.state == 'DISABLED'


def test_what_nobody_operates_any_more_is_paused_with_an_alarm(rig):
    with rig.page() as watching:
        with rig.page() as page:
            follows(rig, page)
        stopped(rig, watching)
        assert watching.state['dead_man']['reason'] in ('closed', *BUSY)
        unattended = 'enabled, and nobody operates: paused after 5 s'
        rig.until(lambda: unattended in [a['text'] for a in watching.state['alarms']], 'the alarm')
        rig.until(lambda: watching.state['operating_state'] == 'PAUSED', 'the pause')
        assert watching.order('acknowledge', alarm='unattended')['ok']


@pytest.mark.nightly
def test_another_server_of_a_page_at_the_handle_is_another_sender(rig):
    with (
        joined_graph('console_web', 'endoscope', rig.domain) as another,
        closing(HandleSender(another.node)),
        rig.page() as page,
    ):
        rig.until(lambda: rig.handle_senders() == ['console_web'], 'the other one')
        # A server of which nobody knows yet cannot be refused.
        rig.passes(1.0)
        why = 'the handle topics are already published by console_web'

        def is_refused():
            answer = page.order('claim')
            page.order('release')
            return why in answer['why']

        rig.until(is_refused, why)
        rig.until(lambda: page.state['lease']['holder'] == '', 'no lease')


def test_nothing_begins_under_a_hand_and_what_a_page_has_begun_is_paused_when_it_goes(rig):
    with rig.page() as page:
        for _ in range(5):
            follows(rig, page)
            answer = page.order('calibrate')
            if not answer['ok'] and 'let go first' in answer['why']:
                break
            # A busy machine let go before, and what was asked for then was free to move.
            page.does(pressed=False, x=0.0)
        assert 'let go first' in answer['why']
        page.does(pressed=False, x=0.0)
        rig.until(lambda: page.dead_man == 'READY')
        page.begin('calibrate')
        rig.until(lambda: page.state['dead_man']['missing'] == 'calibration', 'its motion')
    rig.until(lambda: rig.client.state == 'PAUSED', 'the pause')
    assert rig.stands()


def test_orders_are_published_in_the_graph_with_who_gave_them(rig):
    with rig.page() as page:
        page.order('claim')
        page.order('set', scale=0.5)
        rig.until(lambda: page.state['console']['scale'] == 0.5)
        assert rig.setting('master.scale') == 0.5
        page.order('set', scale=1.0)
        assert not page.order('state', command='home')['ok']
        page.order('release')
        page.order('state', command='enable')
        rig.until(lambda: rig.orders and rig.orders[-1]['order'] == 'state command enable')
    answers = [(one['order'], one['answer']) for one in rig.orders]
    assert answers[:5] == [
        ('claim', 'done'),
        ('set scale 0.5', 'done'),
        ('set scale 1.0', 'done'),
        ('state command home', 'refused'),
        ('lease', 'done'),
    ]
    assert answers[-1] == ('state command enable', 'refused')
    assert rig.orders[0]['operator'] == page.you
    assert CONSOLE_LOG in RECORDED


@pytest.fixture
def operator(rig):
    """A page that operates an enabled slave, and sees that nothing of what happens touches it."""
    with rig.page() as page:
        ready(rig, page)
        session = rig.client.session
        yield page
        assert rig.stands()
        heard_ns = rig.client.state_ns
        rig.until(lambda: rig.client.state_ns > heard_ns, 'the next word of the supervisor')
        assert (rig.client.state, rig.client.session) == ('ENABLED', session)
        assert page.closed is None
        assert page.order('release')['ok']


@pytest.fixture
def place(rig):
    host, _, port = rig.server.address.removeprefix('http://').rpartition(':')
    return host, int(port)


def greeted(rig, stack):
    """A socket for commands after its hello with the operator's token."""
    url = rig.server.address.replace('http', 'ws', 1)
    opened = stack.enter_context(
        connect(f'{url}/command', origin=rig.server.address, compression=None, max_size=None)
    )
    opened.send(json.dumps({'op': 'hello', 'token': rig.server.token}))
    assert json.loads(opened.recv(timeout=_PATIENCE_S))['op'] == 'hello'
    return opened


def counted(rig, page, what, at_least=1):
    """Wait until so many refusals have been counted."""
    name = f'refused: {what}'
    rig.until(lambda: page.state['counters'].get(name, 0) >= at_least, f'{name} in the counters')


def closed(opened) -> int:
    """Close code of a socket that the server ends."""
    with suppress(ConnectionClosed):
        while True:
            opened.recv(timeout=_PATIENCE_S)
    return opened.close_code


def test_what_is_no_frame_and_no_order_and_a_flood_end_their_sender(rig, operator):
    flood = [
        encode_input(InputFrame(**{**_FRAME.__dict__, 'seq': seq + 1}))
        for seq in range(3 * FRAMES_A_SECOND)
    ]
    for sent, codes, check in (
        # Of a sender that goes on sending, TCP may drop the last frames to it.
        ([b'\x02' * _TEN_MEGABYTES], {1009, 1006}, 'frame too large'),
        ([random.Random(1).randbytes(32)], {1008}, 'malformed'),
        (['{"op": "claim"'], {1008}, 'malformed'),
        (flood, {1008}, 'flood'),
    ):
        before = operator.state['counters'].get(f'refused: {check}', 0)
        with ExitStack() as stack:
            other = greeted(rig, stack)
            with suppress(ConnectionClosed):
                for message in sent:
                    other.send(message)
            assert closed(other) in codes, check
        counted(rig, operator, check, before + 1)


def test_strangers_and_other_pages_move_nothing_and_open_nothing(rig, operator, place):
    """All that they may try is asked of the layer itself; here it stands before the server."""
    url = rig.server.address.replace('http', 'ws', 1)
    with connect(f'{url}/command', origin=rig.server.address, compression=None) as other:
        other.send(json.dumps({'op': 'hello', 'token': 'x' * 43}))
        assert closed(other) == 1008
    counted(rig, operator, 'token')
    stranger = 'https://evil.example'
    with pytest.raises(InvalidStatus) as refused, connect(f'{url}/command', origin=stranger):
        pass
    assert refused.value.response.status_code == 403
    counted(rig, operator, 'origin')
    with socket.create_connection(place, _PATIENCE_S) as asking:
        asking.sendall(b'GET / HTTP/1.1\r\nHost: evil.example\r\n\r\nG')
        answer = b''
        with suppress(ConnectionResetError):
            while data := asking.recv(4096):
                answer += data
    assert answer.split()[1] == b'400'
    assert b'connection: close' in answer
    counted(rig, operator, 'host')
    with ExitStack() as stack:
        other = greeted(rig, stack)
        pressed = {**_FRAME.__dict__, 'pressed': True, 'grip': 1000, 'x': 1.0}
        for seq in range(20):
            other.send(encode_input(InputFrame(**{**pressed, 'seq': seq + 1})))
        others = 'frames of others'
        rig.until(lambda: operator.state['counters'].get(others, 0) >= 20, others)
        assert operator.dead_man != 'ENGAGED'
    with ExitStack() as stack:
        for _ in range(1000):
            with suppress(ConnectionResetError):
                stack.enter_context(socket.create_connection(place, _PATIENCE_S))
        assert operator.order('set', scale=0.5)['ok']
    # There is room again.
    with rig.page() as later:
        assert later.order('bags')['ok']
    assert operator.order('set', scale=1.0)['ok']


@pytest.mark.nightly
def test_sockets_that_say_nothing_are_let_in_eight_at_a_time_and_for_two_seconds(rig, operator):
    url = rig.server.address.replace('http', 'ws', 1)
    with ExitStack() as stack:
        silent = []
        begun = time.monotonic()
        with suppress(InvalidStatus):
            for _ in range(UNANSWERED + 1):
                opened = connect(f'{url}/command', origin=rig.server.address, compression=None)
                silent.append(stack.enter_context(opened))
        # On a machine that takes 2 s for eight of them the first are gone before the last comes.
        if time.monotonic() - begun < 1.0:
            assert len(silent) == UNANSWERED
            counted(rig, operator, 'too many sockets without hello')
        assert {closed(opened) for opened in silent} == {1008}
    counted(rig, operator, 'hello', UNANSWERED - 1)


def test_a_killed_server_moves_nothing_on(rig):
    with rig.page() as page:
        follows(rig, page)
        rig.server.process.send_signal(signal.SIGKILL)
        rig.server.process.wait()
        rig.passes(0.5)
        assert rig.stands()


@pytest.mark.nightly
def test_a_terminated_server_releases_and_gives_back(rig):
    with rig.page() as page:
        follows(rig, page)
        assert rig.server.end(signal.SIGTERM) == 0
        rig.until(lambda: rig.clutches[-1] == 0)
        assert rig.stands()
        assert page.wait(lambda: page.closed is not None)


@pytest.mark.nightly
def test_a_graph_that_is_begun_records_nothing_unasked(tmp_path):
    environment = os.environ | {'ROS_DOMAIN_ID': str(private_domain())}
    server = Server(tmp_path, environment, f'--graph=-p tick_rate:={OPERATED_RATE}')
    try:
        server.printed('ready')
        with Page(server.address, server.token) as page:
            assert page.wait(lambda: 'not recording' in str(page.state.get('recorder')))
    finally:
        assert server.end() == 0
    assert list((tmp_path / 'bags').glob('recording-*')) == []
