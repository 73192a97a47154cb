"""The one layer that every request and every socket passes, and the tokens."""

import asyncio
import re
import stat
from collections import Counter
from pathlib import Path

import pytest
from starlette.routing import Route, WebSocketRoute

from endoscope_console.access import OPERATOR, REPORTS, VIEWER, Admission, Gate, Tokens
from endoscope_console.server import Console
from endoscope_core.errors import FileError

OWN = 'http://127.0.0.1:8642'
HOST = (b'host', b'127.0.0.1:8642')
ORIGIN = (b'origin', OWN.encode())
ADMISSION = Admission(frozenset({OWN}))


def scope(kind='websocket', path='/command', headers=(HOST, ORIGIN), method='GET'):
    return {'type': kind, 'path': path, 'headers': list(headers), 'method': method}


def routes():
    """All that the server answers: what is behind them is not needed to list them."""
    return Console.routes(Console.__new__(Console))


def ask(what, admission=ADMISSION):
    """What is sent in answer, and whether the application behind was asked."""
    sent, asked, counts = [], [], Counter()

    async def app(scope, receive, send):
        asked.append(scope)
        if scope['type'] == 'http':
            await send({'type': 'http.response.start', 'status': 200, 'headers': []})
            await send({'type': 'http.response.body', 'body': b''})

    async def send(message):
        sent.append(message)

    asyncio.run(Gate(app, admission, counts)(what, None, send))
    return sent, bool(asked), counts


def test_its_own_page_gets_in():
    assert ask(scope())[1]
    for headers in ((HOST,), (HOST, ORIGIN)):
        sent, asked, counts = ask(scope('http', '/', headers))
        assert asked
        assert sent[0]['status'] == 200
        assert not counts


HOSTILE = {
    'no host': ((ORIGIN,), 'host'),
    'two hosts': ((HOST, HOST, ORIGIN), 'host'),
    'a second host': ((HOST, (b'host', b'evil.example'), ORIGIN), 'host'),
    'another host': (((b'host', b'evil.example:8642'), ORIGIN), 'host'),
    'another port': (((b'host', b'127.0.0.1:8643'), ORIGIN), 'host'),
    'no port': (((b'host', b'127.0.0.1'), ORIGIN), 'host'),
    'localhost': (((b'host', b'localhost:8642'), ORIGIN), 'host'),
    'another page': ((HOST, (b'origin', b'https://evil.example')), 'origin'),
    'null': ((HOST, (b'origin', b'null')), 'origin'),
    'another scheme': ((HOST, (b'origin', b'https://127.0.0.1:8642')), 'origin'),
    'its own and more': ((HOST, (b'origin', OWN.encode() + b'.evil.example')), 'origin'),
    'two origins': ((HOST, ORIGIN, (b'origin', b'https://evil.example')), 'origin'),
    'capitals': ((HOST, (b'Origin', b'https://evil.example')), 'origin'),
}


@pytest.mark.parametrize('route', routes(), ids=lambda route: route.path)
@pytest.mark.parametrize('name', HOSTILE)
def test_every_route_refuses_strangers(route, name):
    headers, check = HOSTILE[name]
    kind = 'websocket' if isinstance(route, WebSocketRoute) else 'http'
    sent, asked, counts = ask(scope(kind, route.path, headers))
    assert not asked
    assert counts == {f'refused: {check}': 1}
    if kind == 'websocket':
        assert [message['type'] for message in sent] == ['websocket.close']
    else:
        assert sent[0]['status'] in (400, 403)


def test_the_routes_are_files_two_sockets_and_reports():
    sockets = {route.path for route in routes() if isinstance(route, WebSocketRoute)}
    assert sockets == {'/telemetry', '/command'}
    others = [route for route in routes() if isinstance(route, Route)]
    assert all(route.methods <= {'GET', 'HEAD'} for route in others)
    plain = re.compile(r'/(static/)?[\w.-]*')
    odd = {route.path for route in others if not plain.fullmatch(route.path)}
    assert odd == {f'{REPORTS}{{secret}}/report.html'}


def test_a_socket_without_origin_needs_the_switch():
    assert not ask(scope(headers=(HOST,)))[1]
    lenient = Admission(ADMISSION.origins, without_origin=True)
    assert ask(scope(headers=(HOST,)), lenient)[1]
    for origin in (b'null', b'https://evil.example'):
        assert not ask(scope(headers=(HOST, (b'origin', origin))), lenient)[1]


@pytest.mark.parametrize('method', ['POST', 'PUT', 'OPTIONS', 'CONNECT', 'TRACE'])
def test_only_reading_is_answered(method):
    sent, asked, counts = ask(scope('http', '/', (HOST,), method))
    assert not asked
    assert sent[0]['status'] == 405
    assert counts == {'refused: method': 1}


def test_what_is_no_request_is_not_passed_on():
    assert not ask(scope('lifespan'))[1]
    assert not ask(scope('webtransport'))[1]


def test_every_answer_has_its_headers():
    for headers in ((HOST,), ((b'host', b'evil.example'),)):
        sent, _, _ = ask(scope('http', '/', headers))
        given = dict(sent[0]['headers'])
        assert b"default-src 'none'" in given[b'content-security-policy']
        assert b'unsafe' not in given[b'content-security-policy']
        assert given[b'x-content-type-options'] == b'nosniff'
        assert given[b'cache-control'] == b'no-store'
        assert given[b'referrer-policy'] == b'no-referrer'
    sent, _, _ = ask(scope('http', f'{REPORTS}x/report.html', (HOST,)))
    assert b'sandbox allow-scripts' in dict(sent[0]['headers'])[b'content-security-policy']


def test_a_token_says_who_one_is():
    tokens = Tokens.new()
    assert tokens.role(tokens.operator) == OPERATOR
    assert tokens.role(tokens.viewer) == VIEWER
    assert tokens != Tokens.new()
    for wrong in ('', tokens.operator[:-1], tokens.operator + 'x', 'ä' * 300):
        assert tokens.role(wrong) == ''


def test_tokens_are_kept_where_this_user_alone_can_read_them(tmp_path):
    file = tmp_path / 'tokens'
    tokens = Tokens.of_file(file)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert Tokens.of_file(file) == tokens
    file.chmod(0o644)
    with pytest.raises(FileError, match='chmod 600'):
        Tokens.of_file(file)


@pytest.mark.parametrize(
    'text', ['', 'operator x\nviewer y\n', 'a b c\n', f'operator {"a" * 43}\nviewer {"a" * 43}\n']
)
def test_a_file_that_has_no_two_tokens_is_refused(tmp_path: Path, text):
    file = tmp_path / 'tokens'
    file.write_text(text)
    file.chmod(0o600)
    with pytest.raises(FileError, match='two'):
        Tokens.of_file(file)
