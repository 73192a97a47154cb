"""The server of the console among those who mean it no good: refused, counted, nothing touched."""

import json
import random
import socket
import time
from contextlib import ExitStack, suppress

import pytest
from console_rig import ConsoleRig, ready
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from endoscope_console.clients import FRAMES_A_SECOND, UNANSWERED
from endoscope_console.teleop.frames import InputFrame, encode_input

_PATIENCE_S = 60.0
_REQUEST = 'GET / HTTP/1.1\r\n{}\r\n\r\n'
_TEN_MEGABYTES = 10_000_000
_FRAME = InputFrame(False, False, True, True, False, 0, 1, 0, 0, 0.0, 0.0, 0.0)


@pytest.fixture(scope='module')
def rig(tmp_path_factory):
    with ConsoleRig(tmp_path_factory.mktemp('hostile')) as rig:
        yield rig


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
    """A socket for commands that has said hello with the operator's token."""
    url = rig.server.address.replace('http', 'ws', 1)
    opened = stack.enter_context(
        connect(f'{url}/command', origin=rig.server.address, compression=None, max_size=None)
    )
    opened.send(json.dumps({'op': 'hello', 'token': rig.server.token}))
    assert json.loads(opened.recv(timeout=_PATIENCE_S))['op'] == 'hello'
    return opened


def counted(rig, page, what, at_least=1):
    """Wait until so many refusals have been told."""
    name = f'refused: {what}'
    rig.until(lambda: page.state['counters'].get(name, 0) >= at_least, f'{name} in the counters')


def closed(opened) -> int:
    """Close code of a socket that the server ends."""
    with suppress(ConnectionClosed):
        while True:
            opened.recv(timeout=_PATIENCE_S)
    return opened.close_code


@pytest.mark.parametrize(
    ('sent', 'codes', 'check'),
    [
        # Of a sender that goes on sending, TCP may drop what it was told in the end.
        (b'\x02' * _TEN_MEGABYTES, {1009, 1006}, 'frame too large'),
        (b'\x02short', {1008}, 'malformed'),
        (random.Random(1).randbytes(32), {1008}, 'malformed'),
        ('{"op": "claim"', {1008}, 'malformed'),
        ('{"op": "format_the_disk", "id": 1}', {1008}, 'malformed'),
        ('{"op": "set", "id": 1, "scale": 1e999}', {1008}, 'malformed'),
    ],
    ids=['ten megabytes', 'short', 'noise', 'half JSON', 'unknown', 'infinite'],
)
def test_what_is_no_frame_and_no_order_ends_its_sender(rig, operator, sent, codes, check):
    with ExitStack() as stack:
        other = greeted(rig, stack)
        with suppress(ConnectionClosed):
            other.send(sent)
        assert closed(other) in codes
    counted(rig, operator, check)


def test_a_flood_ends_its_sender(rig, operator):
    with ExitStack() as stack:
        other = greeted(rig, stack)
        with suppress(ConnectionClosed):
            for seq in range(3 * FRAMES_A_SECOND):
                other.send(encode_input(InputFrame(**{**_FRAME.__dict__, 'seq': seq + 1})))
        assert closed(other) == 1008
    counted(rig, operator, 'flood')


def test_a_connection_is_for_one_request(place):
    host, port = place
    with socket.create_connection(place, _PATIENCE_S) as asking:
        asking.sendall(f'GET /nothing HTTP/1.1\r\nHost: {host}:{port}\r\n\r\nG'.encode())
        answer = b''
        with suppress(ConnectionResetError):
            while data := asking.recv(4096):
                answer += data
    assert b'connection: close' in answer


def test_frames_of_somebody_else_move_nothing(rig, operator):
    with ExitStack() as stack:
        other = greeted(rig, stack)
        pressed = {**_FRAME.__dict__, 'pressed': True, 'grip': 1000, 'x': 1.0}
        for seq in range(20):
            other.send(encode_input(InputFrame(**{**pressed, 'seq': seq + 1})))
        others = 'frames of others'
        rig.until(lambda: operator.state['counters'].get(others, 0) >= 20, others)
        assert operator.dead_man != 'ENGAGED'


@pytest.mark.parametrize('token', ['', 'x' * 43, 'x' * 4000])
def test_a_wrong_token_opens_nothing(rig, operator, token):
    url = rig.server.address.replace('http', 'ws', 1)
    with connect(f'{url}/command', origin=rig.server.address, compression=None) as other:
        other.send(json.dumps({'op': 'hello', 'token': token}))
        assert closed(other) == 1008
    counted(rig, operator, 'token')


@pytest.mark.parametrize('origin', ['https://evil.example', 'null', None])
def test_another_page_opens_no_socket(rig, operator, origin):
    url = rig.server.address.replace('http', 'ws', 1)
    with pytest.raises(InvalidStatus) as refused, connect(f'{url}/command', origin=origin):
        pass
    assert refused.value.response.status_code == 403
    counted(rig, operator, 'origin')


@pytest.mark.parametrize(
    'hosts', [('evil.example',), (), ('{own}', 'evil.example'), ('{own}', '{own}')]
)
def test_another_name_of_this_machine_is_no_way_in(rig, operator, place, hosts):
    own = '{}:{}'.format(*place)
    headers = '\r\n'.join(f'Host: {host.format(own=own)}' for host in hosts) or 'X-Empty: 1'
    with socket.create_connection(place, _PATIENCE_S) as asking:
        asking.sendall(_REQUEST.format(headers).encode())
        assert asking.recv(4096).split()[1] == b'400'
    if hosts:
        counted(rig, operator, 'host')


def test_a_thousand_connections_leave_the_operator_alone(rig, operator, place):
    with ExitStack() as stack:
        for _ in range(1000):
            with suppress(ConnectionResetError):
                stack.enter_context(socket.create_connection(place, _PATIENCE_S))
        assert operator.order('set', scale=0.5)['ok']
    # There is room again.
    with rig.page() as later:
        assert later.order('bags')['ok']
    assert operator.order('set', scale=1.0)['ok']


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
