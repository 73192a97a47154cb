"""The server between the graph and its pages: files, two sockets, and pictures of the graph."""

import asyncio
import json
import mimetypes
import time
import traceback
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from endoscope_console.access import REPORTS, Admission, Gate, Tokens
from endoscope_console.clients import HELLO_S, ORDERS_AT_ONCE, Client, Clients, Kind
from endoscope_console.explanations import REPORT_FILE
from endoscope_console.graph_side import GraphSide
from endoscope_console.operations import Operations
from endoscope_console.orders import HALTS, MalformedOrderError, StateOrder, read_hello, read_order
from endoscope_console.pictures import SIGNALS
from endoscope_console.teleop.frames import POINTS, VERSION, MalformedFrameError, decode_input
from endoscope_console.teleop.operator import Reason
from endoscope_console.view import View
from endoscope_core.choices import MODES
from endoscope_core.rig import Rig
from endoscope_nodes.names import JOINTS
from endoscope_pages import ASSETS

PAGE = Path(__file__).with_name('page')
_SERVED = ('.css', '.html', '.js', '.svg')
_UNWATCHED_NS = 100_000_000
_MALFORMED, _AGAIN, _TOO_LARGE = 1008, 1013, 1009


@dataclass
class Console:
    """Everything that the sockets need; lives in the thread of the sockets."""

    graph: GraphSide
    operations: Operations
    clients: Clients
    view: View
    tokens: Tokens  # who may do what
    rig: Rig  # whose limits and measures pages receive
    counts: Counter[str]  # of what was refused and dropped
    rate: int  # of pictures, in Hz

    def app(self, admission: Admission) -> Gate:
        """The application, behind the one layer that all passes."""
        return Gate(Starlette(routes=self.routes()), admission, self.counts)

    def routes(self) -> list[BaseRoute]:
        """All that is answered: each file by its own route, the sockets and the reports."""
        files: dict[str, Path] = {
            **_files(PAGE, '/'),
            **_files(ASSETS, '/static/'),
        }
        if '/index.html' in files:
            files['/'] = files['/index.html']
        return [
            *(Route(path, _file(file), methods=['GET']) for path, file in files.items()),
            Route(f'{REPORTS}{{secret}}/{REPORT_FILE}', self._report, methods=['GET']),
            WebSocketRoute('/telemetry', self._telemetry),
            WebSocketRoute('/command', self._command),
        ]

    async def _report(self, request: Request) -> Response:
        secret, operations = request.path_params['secret'], self.operations
        file = operations.explanations.file_of(secret) or operations.investigations.file_of(secret)
        if file is None:
            return PlainTextResponse('there is no such report\n', 404)
        return FileResponse(file, media_type='text/html')

    async def _greet(self, socket: WebSocket, kind: Kind) -> Client | None:
        """Take the first words of a socket; its client, or None where it may not be one."""
        if not self.clients.knock():
            await socket.close(_AGAIN)
            return None
        try:
            await socket.accept()
            try:
                async with asyncio.timeout(HELLO_S):
                    message = await socket.receive()
            except TimeoutError:
                await self._turn_away(socket, 'hello', f'no hello for {HELLO_S:g} s')
                return None
        finally:
            self.clients.answered()
        if message['type'] == 'websocket.disconnect':
            self._note_end(message)
            return None
        try:
            hello = read_hello(message.get('text') or '')
        except MalformedOrderError as error:
            await self._turn_away(socket, 'hello', str(error))
            return None
        role = self.tokens.role(hello.token)
        if not role:
            await self._turn_away(socket, 'token', 'this token opens nothing here')
            return None
        address = socket.client.host if socket.client else ''
        client = self.clients.admit(kind, role, address)
        if isinstance(client, str):
            await socket.close(_AGAIN, client)
            return None
        return client

    async def _turn_away(self, socket: WebSocket, check: str, why: str) -> None:
        self.counts[f'refused: {check}'] += 1
        await socket.close(_MALFORMED, _short(why))

    def _note_end(self, message: Mapping[str, Any]) -> None:
        if message.get('code') == _TOO_LARGE:
            self.counts['refused: frame too large'] += 1

    def _welcome(self, client: Client) -> str:
        return json.dumps(
            {
                'op': 'hello',
                'version': VERSION,
                'you': client.id,
                'role': client.role,
                'grips': self.operations.controls.beat.grips,
                'signals': SIGNALS,
                'joints': JOINTS,
                'limits': {
                    'reach': self.rig.joints.reach,
                    'tension_ceiling': self.rig.tension.ceiling,
                    'force': self.rig.tip.force_limit,
                    'force_alarm': self.rig.tip.force_alarm,
                },
                'section_length': self.rig.instrument.section_length,
                'points': POINTS,
                'rate': self.rate,
                'modes': MODES,
            }
        )

    async def _telemetry(self, socket: WebSocket) -> None:
        client = await self._greet(socket, 'telemetry')
        if client is None:
            return
        await socket.send_text(self._welcome(client))
        client.outbox.put_state(self.view.whole(time.monotonic_ns()))
        sending = asyncio.create_task(_send(socket, client))
        try:
            message = await socket.receive()
            self._note_end(message)
            if message['type'] != 'websocket.disconnect':
                await self._turn_away(socket, 'words on telemetry', 'nothing is heard here')
        finally:
            self.clients.leave(client)
            sending.cancel()
            await asyncio.wait({sending})

    async def _command(self, socket: WebSocket) -> None:
        client = await self._greet(socket, 'command')
        if client is None:
            return
        await socket.send_text(self._welcome(client))
        tasks: set[asyncio.Task[None]] = set()

        def start(work: Callable[..., Awaitable[None]], *words: Any) -> None:
            task = asyncio.ensure_future(work(*words))
            tasks.add(task)
            task.add_done_callback(ended)

        def ended(task: asyncio.Task[None]) -> None:
            tasks.discard(task)
            if not task.cancelled() and (error := task.exception()) is not None:
                traceback.print_exception(error)

        client.notify = lambda message: start(_send_object, socket, message)
        try:
            while True:
                message = await socket.receive()
                arrived_ns = time.monotonic_ns()
                if message['type'] == 'websocket.disconnect':
                    self._note_end(message)
                    return
                if client.rate.exceeded(arrived_ns):
                    self.operations.controls.refuse(client, Reason.FLOOD, arrived_ns)
                    await socket.close(_MALFORMED, 'too many frames')
                    return
                try:
                    if message.get('bytes') is not None:
                        frame = decode_input(message['bytes'])
                        self.operations.controls.hear(client, frame, arrived_ns)
                    else:
                        order = read_order(message.get('text') or '')
                        start(self._obey, socket, client, order)
                except (MalformedFrameError, MalformedOrderError) as error:
                    self.operations.controls.refuse(client, Reason.MALFORMED, arrived_ns)
                    await socket.close(_MALFORMED, _short(str(error)))
                    return
        finally:
            client.notify = lambda message: None
            self.clients.leave(client)
            self.operations.controls.closed(client)

    async def _obey(self, socket: WebSocket, client: Client, order: Any) -> None:
        halts = isinstance(order, StateOrder) and order.command in HALTS
        if client.orders >= ORDERS_AT_ONCE and not halts:
            why = f'{ORDERS_AT_ONCE} orders are not done yet'
            answer: dict[str, Any] = {'op': 'answer', 'id': order.id, 'ok': False, 'why': why}
        else:
            client.orders += 1
            try:
                answer = await self.operations.obey(client, order)
            except Exception:
                # Its page waits for an answer, whatever has gone wrong here.
                why = 'the server failed in it; its terminal says how'
                await _send_object(
                    socket, {'op': 'answer', 'id': order.id, 'ok': False, 'why': why}
                )
                raise
            finally:
                client.orders -= 1
        await _send_object(socket, answer)

    async def make_pictures(self) -> None:
        """Hear the graph, and show it to all, until cancelled."""
        due_ns, period_ns = time.monotonic_ns(), round(1e9 / self.rate)
        while True:
            now_ns = time.monotonic_ns()
            if not self.operations.controls.beat.alive:
                raise RuntimeError('the thread that publishes the handle topics has ended')
            self.graph.hear(now_ns)
            picture = self.graph.pictures.make(now_ns, time.time_ns())
            self.operations.controls.turn(now_ns)
            state = self.view.changes(now_ns)
            watching = self.clients.of('telemetry')
            for client in watching:
                client.outbox.put_picture(picture)
                if state:
                    client.outbox.put_state(state)
            watched = watching or self.operations.controls.lease.holder
            due_ns = max(due_ns + (period_ns if watched else _UNWATCHED_NS), now_ns)
            await asyncio.sleep((due_ns - time.monotonic_ns()) * 1e-9)


def _files(folder: Path, below: str) -> dict[str, Path]:
    """Files of a folder by the path of their address."""
    return {
        f'{below}{path.relative_to(folder).as_posix()}': path
        for path in sorted(folder.rglob('*'))
        if path.is_file() and path.suffix in _SERVED
    }


def _file(path: Path) -> Callable[[Request], Awaitable[Response]]:
    kind = mimetypes.guess_type(path.name)[0]

    async def answer(_: Request) -> Response:
        return Response(path.read_bytes(), media_type=kind)

    return answer


def _short(why: str) -> str:
    """As much of a reason as fits into a socket's last frame."""
    return why.encode()[:120].decode(errors='ignore')


async def _send(socket: WebSocket, client: Client) -> None:
    """Send a client's queue, one item after the other, as fast as it takes them."""
    try:
        while socket.application_state is WebSocketState.CONNECTED:
            what = await client.outbox.get()
            if isinstance(what, bytes):
                await socket.send_bytes(what)
            else:
                await socket.send_text(what)
    except WebSocketDisconnect:
        # It is gone; the socket's reader knows, and sees to it.
        return


async def _send_object(socket: WebSocket, message: Mapping[str, Any]) -> None:
    if socket.application_state is WebSocketState.CONNECTED:
        with suppress(WebSocketDisconnect):
            await socket.send_text(json.dumps(message))
