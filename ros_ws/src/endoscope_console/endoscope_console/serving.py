"""Runs the server of the page: graph, threads, signals and messages on the terminal."""

import argparse
import asyncio
import gc
import ipaddress
import shlex
import signal
import socket
import ssl
import subprocess
import sys
import time
from collections import Counter
from contextlib import ExitStack, nullcontext
from typing import Any
from urllib.parse import urlsplit

import uvicorn
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from endoscope_console.access import Admission, Tokens
from endoscope_console.alarms import Alarms
from endoscope_console.background import BackgroundCommand
from endoscope_console.beat import Beat
from endoscope_console.clients import OF_A_KIND, UNANSWERED, Clients
from endoscope_console.controls import Controls
from endoscope_console.explanations import Explanations
from endoscope_console.graph_side import GraphSide, graph_side
from endoscope_console.investigations import Investigations
from endoscope_console.operations import Operations
from endoscope_console.orders import LARGEST_BYTES
from endoscope_console.server import Console
from endoscope_console.teleop.pad import SPEEDS, PadHandle
from endoscope_console.view import View
from endoscope_core.errors import EndoscopeError
from endoscope_core.rig import Rig, load_rig
from endoscope_nodes.client.graph_client import WHOLE_S
from endoscope_nodes.client.graph_listener import RECORDER, SUPERVISOR
from endoscope_nodes.names import BAG, JOINTS
from endoscope_nodes.program import NODES, REAL_TIME
from endoscope_nodes.runtime.runtime import GC_THRESHOLDS, SWITCH_INTERVAL_S

# Where this process is killed, the graph ends as it does by Ctrl-C.
_GRAPH = """
import ctypes, signal, sys
PR_SET_PDEATHSIG = 1
ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGINT)
from endoscope_nodes.program import graph
sys.exit(graph())
"""
_ANSWERS_S = 1.5
_LOOK_S = 0.1
_ENDS_S = 20.0
_DROPPED_S = 2
_SEND_BUFFER = 16_384
_WRITE_BUFFER = 4096
CONNECTIONS = 3 * OF_A_KIND + 2 * UNANSWERED
"""At once: both sockets of each page, and requests for files."""
_STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class _Server(uvicorn.Server):
    """Leaves signals to whoever serves."""

    def capture_signals(self) -> Any:
        """Capture none."""
        return nullcontext()


class _Graph:
    """The graph that this command starts, where none answers."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._words = [REAL_TIME] if args.real_time else []
        self._words += ['--ros-args', '-p', 'source:=master']
        if args.namespace.strip('/') != 'endoscope':
            self._words += ['-r', f'__ns:=/{args.namespace.strip("/")}']
        if args.rig is not None:
            self._words += ['-p', f'rig_file:={args.rig.resolve()}']
        self._words += shlex.split(args.graph)
        self._process: subprocess.Popen | None = None

    async def start_unless_one_answers(self, graph: GraphSide) -> None:
        """Start it, if nobody is there within 1.5 s."""
        for _ in range(round(_ANSWERS_S / _LOOK_S)):
            if graph.client.state or set(graph.client.nodes()) & set(NODES):
                return
            await asyncio.sleep(_LOOK_S)
        # Ctrl-C at the terminal is for the page first, which then ends the graph.
        self._process = subprocess.Popen(
            [sys.executable, '-c', _GRAPH, *self._words],
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )

    @property
    def ended(self) -> int | None:
        """Status with which it has ended by itself; None while it runs, or was never started."""
        return None if self._process is None else self._process.poll()

    def end(self) -> None:
        """End it as Ctrl-C does, and wait for it."""
        if self._process is None or self._process.poll() is not None:
            return
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(_ENDS_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            print('console: the graph did not end when asked to, and was killed', flush=True)


def serve(args: argparse.Namespace) -> int:
    """Serve the page until a signal asks to end; 0."""
    rig = load_rig(args.rig)
    tokens = Tokens.of_file(args.token_file) if args.token_file else Tokens.new()
    _check_privacy(args)
    listening = _listen(args.host, args.port)
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    started = _Graph(args)
    with ExitStack() as stack:
        stack.enter_context(listening)
        graph = stack.enter_context(graph_side(args.namespace, rig.instrument.section_length))
        if args.viewers:
            # Its SDK is large, and few ask for it.
            from endoscope_console.viewers import viewers

            seen = stack.enter_context(viewers(args.namespace, args.viewers_port))
            print(f'viewers read  {seen}')
        stack.callback(started.end)
        asyncio.run(_serve(args, listening, graph, started, rig, tokens))
    return 0


async def _serve(
    args: argparse.Namespace,
    listening: socket.socket,
    graph: GraphSide,
    started: _Graph,
    rig: Rig,
    tokens: Tokens,
) -> None:
    counts: Counter[str] = Counter()
    clients = Clients(counts)
    background = BackgroundCommand()
    explanations = Explanations(args.bags, background)
    investigations = Investigations(args.bags, explanations, background)
    limits = (rig.joints.hand_speed,) * len(JOINTS)
    with Beat(graph.client.node, PadHandle(len(JOINTS), (SPEEDS,) * len(JOINTS), limits)) as beat:
        controls = Controls(graph, beat, clients, counts)
        operations = Operations(controls, explanations, investigations, Alarms())
        view = View(operations, rig, counts, args.rate)
        console = Console(
            graph,
            operations,
            clients,
            view=view,
            tokens=tokens,
            rig=rig,
            counts=counts,
            rate=args.rate,
        )
        address = _address(args, listening)
        admission = Admission(frozenset((address, *args.origin)), args.allow_no_origin)
        server = _Server(_configuration(args, console, admission))
        stop = asyncio.Event()
        for number in _STOPPING:
            asyncio.get_running_loop().add_signal_handler(number, stop.set)
        gc.collect()
        gc.freeze()
        gc.set_threshold(*GC_THRESHOLDS)
        answering = asyncio.create_task(server.serve(sockets=[listening]))
        others: set[asyncio.Task[Any]] = {
            asyncio.create_task(console.make_pictures()),
            asyncio.create_task(_announce(args, address, tokens, graph, started)),
            asyncio.create_task(stop.wait()),
        }
        try:
            done, _ = await asyncio.wait({answering, *others}, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            await operations.close()
            await background.close()
            server.should_exit = True
            await asyncio.wait({answering})
            for task in others:
                task.cancel()
            await asyncio.wait(others)


async def _announce(
    args: argparse.Namespace, address: str, tokens: Tokens, graph: GraphSide, started: _Graph
) -> None:
    """Print the addresses, ensure a graph, and report when it answers."""
    page = f'{address}/#token={tokens.operator}'
    print(f'operate at    {page}')
    print(f'look on at    {address}/#token={tokens.viewer}', flush=True)
    if not args.no_graph:
        await started.start_unless_one_answers(graph)
    while not graph.client.state:
        if started.ended is not None:
            raise EndoscopeError(
                f'the graph has ended with status {started.ended}, as it says above'
            )
        await asyncio.sleep(_LOOK_S)
    await _until_whole(graph, started)
    recorder = graph.client.health.get(RECORDER)
    if recorder is not None and BAG in recorder.values:
        print(f'recorder      {recorder.message} to {recorder.values[BAG]}', flush=True)
    print(f'ready         slave {graph.client.state}; Ctrl-C ends', flush=True)
    while started.ended is None:
        await asyncio.sleep(_LOOK_S)
    graph.ended = started.ended
    print(f'console: the graph has ended with status {started.ended}', flush=True)
    await asyncio.Event().wait()


async def _until_whole(graph: GraphSide, started: _Graph) -> None:
    """Wait for the streams that motion depends on, and print which are missing."""
    client, end, printed = graph.client, time.monotonic() + WHOLE_S, ''
    while started.ended is None:
        spoke = SUPERVISOR in client.health
        spoke = spoke and (RECORDER in client.health or 'recorder' not in client.nodes())
        if spoke and not client.awaited:
            return
        if client.awaited and client.awaited != printed:
            printed = client.awaited
            print(f'waiting       {printed}', flush=True)
        if time.monotonic() > end:
            return
        await asyncio.sleep(_LOOK_S)


class _Sockets(WebSocketsSansIOProtocol):
    """Sockets that hold little back: a slow reader is dropped pictures, not sent old ones."""

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        # What waits in the kernel and in the transport is already old when it is read.
        transport.set_write_buffer_limits(high=_WRITE_BUFFER)
        plain = transport.get_extra_info('socket')
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)

    def keepalive_timeout(self) -> None:
        """Drop a client that does not answer, and its queue."""
        super().keepalive_timeout()
        self.transport.abort()


def _configuration(
    args: argparse.Namespace, console: Console, admission: Admission
) -> uvicorn.Config:
    return uvicorn.Config(
        console.app(admission),
        ws=_Sockets,
        limit_concurrency=CONNECTIONS,
        lifespan='off',
        log_config=None,
        log_level='error',
        access_log=False,
        proxy_headers=False,
        server_header=False,
        date_header=False,
        ws_max_size=LARGEST_BYTES,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=_DROPPED_S,
        ssl_certfile=args.certificate,
        ssl_keyfile=args.key,
    )


def _check_privacy(args: argparse.Namespace) -> None:
    """Refuse to send tokens in the clear to other machines, and origins that no browser names."""
    for origin in args.origin:
        parts = urlsplit(origin)
        if parts.scheme not in ('http', 'https') or origin != f'{parts.scheme}://{parts.netloc}':
            raise EndoscopeError(
                f'--origin {origin}: give SCHEME://HOST:PORT, and nothing after it'
            )
    if (args.certificate is None) != (args.key is None):
        raise EndoscopeError('--certificate and --key belong together')
    for file in (args.certificate, args.key):
        if file is not None and not file.is_file():
            raise EndoscopeError(f'{file}: no such file')
    if args.certificate is not None:
        try:
            # A key that asks for a password would wait for one at the terminal.
            ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(
                args.certificate, args.key, password=''
            )
        except (ssl.SSLError, OSError) as error:
            raise EndoscopeError(
                f'{args.certificate} and {args.key} are not a PEM certificate and its key without '
                f'a password: {error}'
            ) from error
    try:
        address = ipaddress.ip_address(args.host)
    except ValueError:
        address = None
    if address is not None and address.is_unspecified:
        raise EndoscopeError(
            f'--host {args.host}: give the one address of this machine that browsers call'
        )
    here = args.host == 'localhost' or (address is not None and address.is_loopback)
    if not here and args.certificate is None:
        raise EndoscopeError(
            f'--host {args.host}: other machines would send the token for all to read; give '
            '--certificate and --key'
        )


def _listen(host: str, port: int) -> socket.socket:
    """Listen at one address; EndoscopeError where that is taken or not of this machine."""
    family = socket.AF_INET6 if ':' in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen(128)
    except OSError as error:
        listening.close()
        raise EndoscopeError(
            f'cannot listen at {host}:{port}: {error.strerror}; give another --host or --port'
        ) from error
    return listening


def _address(args: argparse.Namespace, listening: socket.socket) -> str:
    scheme, usual = ('https', 443) if args.certificate else ('http', 80)
    host = f'[{args.host}]' if ':' in args.host else args.host
    port = listening.getsockname()[1]
    return f'{scheme}://{host}' + (f':{port}' if port != usual else '')
