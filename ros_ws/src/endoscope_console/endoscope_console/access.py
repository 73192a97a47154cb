"""Access control: one layer that every request and every socket passes, and the tokens of a hello.

Each of the three checks is against another attacker: the token against other users of this machine,
the ``Host`` against pages whose name was pointed at this machine (DNS rebinding), the ``Origin``
against other pages in the operator's own browser.
"""

import hmac
import secrets
import stat
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endoscope_core.atomic_output import atomic_file
from endoscope_core.errors import FileError

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

OPERATOR, VIEWER = 'operator', 'viewer'
REPORTS = '/report/'
"""Path below which reports are, whose pages carry scripts of their own."""

_TOKEN_BYTES = 32
_LONGEST_TOKEN = 200
_METHODS = ('GET', 'HEAD')
_PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
_REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'"
)
_HEADERS = (
    (b'x-content-type-options', b'nosniff'),
    (b'referrer-policy', b'no-referrer'),
    (b'cross-origin-opener-policy', b'same-origin'),
    (b'cross-origin-resource-policy', b'same-origin'),
    (b'cache-control', b'no-store'),
    # Between two requests of one connection nobody's patience runs out.
    (b'connection', b'close'),
)


@dataclass(frozen=True)
class Refusal:
    """Why access is refused."""

    status: int  # of the answer to a request
    check: str  # name of the check, by which it is counted
    why: str


@dataclass(frozen=True)
class Admission:
    """What a request must carry to get in."""

    # The page's own, for example ``http://127.0.0.1:8765``; a ``Host`` is the rest of one of them.
    origins: frozenset[str]
    without_origin: bool = False  # a program may open a socket without naming an origin

    @property
    def hosts(self) -> frozenset[str]:
        """Names with port under which the server is reached."""
        return frozenset(origin.partition('://')[2] for origin in self.origins)

    def refusal(self, scope: Mapping[str, Any]) -> Refusal | None:
        """Judge a request or a socket by its ASGI scope; None where it may pass."""
        if scope['type'] not in ('http', 'websocket'):
            return Refusal(404, 'kind', f'nothing here is of kind {scope["type"]}')
        hosts = _values(scope, b'host')
        if len(hosts) != 1:
            return Refusal(400, 'host', f'{len(hosts)} headers Host instead of one')
        if hosts[0] not in self.hosts:
            known = ' or '.join(sorted(self.origins))
            return Refusal(400, 'host', f'the page is at {known}')
        origins = _values(scope, b'origin')
        if origins and (len(origins) > 1 or origins[0] not in self.origins):
            return Refusal(403, 'origin', 'another page has no business here')
        if scope['type'] == 'websocket':
            if not origins and not self.without_origin:
                return Refusal(
                    403, 'origin', 'no origin; `--allow-no-origin` lets programs open sockets'
                )
        elif scope['method'] not in _METHODS:
            return Refusal(405, 'method', f'{scope["method"]} is not answered here')
        return None


def _values(scope: Mapping[str, Any], name: bytes) -> list[str]:
    return [value.decode('latin-1') for key, value in scope['headers'] if key.lower() == name]


class Gate:
    """Lets in what an :class:`Admission` admits, counts the refused by check, and sets headers."""

    def __init__(self, app: App, admission: Admission, counts: Counter[str]) -> None:
        self._app = app
        self._admission = admission
        self._counts = counts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer as ASGI asks."""
        refusal = self._admission.refusal(scope)
        if refusal is None and scope['type'] == 'websocket':
            await self._app(scope, receive, send)
            return
        if refusal is not None:
            self._counts[f'refused: {refusal.check}'] += 1
        if scope['type'] == 'websocket':
            await send({'type': 'websocket.close', 'code': 1008})
        elif scope['type'] == 'http':
            if refusal is None:
                await self._app(scope, receive, _with_headers(scope, send))
            else:
                await _answer(refusal, _with_headers(scope, send))


def _with_headers(scope: Scope, send: Send) -> Send:
    path = scope['path']
    policy = _REPORT_POLICY if path.startswith(REPORTS) else _PAGE_POLICY
    own = (*_HEADERS, (b'content-security-policy', policy.encode()))
    names = {name for name, _ in own}

    async def send_with(message: Message) -> None:
        if message['type'] == 'http.response.start':
            others = [(k, v) for k, v in message.get('headers', ()) if k.lower() not in names]
            message['headers'] = [*others, *own]
        await send(message)

    return send_with


async def _answer(refusal: Refusal, send: Send) -> None:
    headers = [(b'content-type', b'text/plain; charset=utf-8')]
    await send({'type': 'http.response.start', 'status': refusal.status, 'headers': headers})
    await send({'type': 'http.response.body', 'body': f'{refusal.why}\n'.encode()})


@dataclass(frozen=True)
class Tokens:
    """Two secrets: one grants operating, the other viewing."""

    operator: str  # at least 32 random bytes, as text that fits into an address
    viewer: str

    @classmethod
    def new(cls) -> 'Tokens':
        """Make two that nobody can guess."""
        return cls(*(secrets.token_urlsafe(_TOKEN_BYTES) for _ in range(2)))

    @classmethod
    def of_file(cls, path: Path) -> 'Tokens':
        """Read them from a file, or write new ones there that this user alone can read."""
        if not path.exists():
            tokens = cls.new()
            with atomic_file(path) as part:
                part.touch(mode=0o600)
                part.write_text(f'{OPERATOR} {tokens.operator}\n{VIEWER} {tokens.viewer}\n')
            return tokens
        if stat.S_IMODE(path.stat().st_mode) & 0o077:
            raise FileError(f'{path}: others can read it; `chmod 600 {path}` ends that')
        try:
            lines = dict(line.split() for line in path.read_text('ascii').splitlines() if line)
            tokens = cls(lines[OPERATOR], lines[VIEWER])
        except (ValueError, KeyError) as error:
            raise FileError(
                f"{path}: give two lines, '{OPERATOR} TOKEN' and '{VIEWER} TOKEN'"
            ) from error
        shortest = min(len(tokens.operator), len(tokens.viewer))
        if shortest < _TOKEN_BYTES or tokens.operator == tokens.viewer:
            raise FileError(f'{path}: two tokens of at least {_TOKEN_BYTES} characters')
        return tokens

    def role(self, token: str) -> str:
        """Return the role that a token grants: operator, viewer, or empty for none."""
        given = token[:_LONGEST_TOKEN].encode()
        # Both are always compared, so that the duration reveals nothing.
        operates = hmac.compare_digest(given, self.operator.encode())
        looks_on = hmac.compare_digest(given, self.viewer.encode())
        return OPERATOR if operates else VIEWER if looks_on else ''
