"""`endoscope bench busy`: the first session and the console's first minutes on a busy machine."""

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from endoscope_lab.bench import table_head, table_row
from endoscope_lab.console.chromium import BrowserError
from endoscope_lab.console.hand import Hand
from endoscope_lab.console.relay import Relay
from endoscope_lab.console.served_console import ConsoleError, ServedConsole
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.client.graph_parameters import set_parameters
from endoscope_nodes.runtime.private_domain import private_domain


def run(args: argparse.Namespace) -> int:
    """Print a line for each trial and a table; return 1 if one of them failed."""
    domain = private_domain()
    rows: dict[str, list[str]] = {'shell': [], 'console': []}
    with busy_loops(args.loops):
        for k in range(args.n):
            for name, trial in (('shell', shell_trial), ('console', console_trial)):
                began, load = time.monotonic(), os.getloadavg()[0]
                with tempfile.TemporaryDirectory() as folder:
                    trouble = trial(Path(folder), domain)
                rows[name].append(trouble)
                took = time.monotonic() - began
                said = trouble or 'every step'
                print(
                    f'{name} {k + 1} of {args.n}: {said} ({took:.0f} s, load {load:.1f})',
                    flush=True,
                )
    failed = any(map(any, rows.values()))
    if args.minutes > 0.0:
        with busy_loops(2), tempfile.TemporaryDirectory() as folder:
            trouble, figures = long_motion(Path(folder), domain, 60.0 * args.minutes)
        failed |= bool(trouble)
        loops = f'{args.minutes:g} min beside Chromium and two loops'
        print(f'{loops}: {trouble or "no fault"}, {figures}')
    if args.n:
        print(table_head('session', 'trials', 'every step'))
        for name, troubles in rows.items():
            print(table_row(name, len(troubles), troubles.count('')))
    return int(failed)


_PATIENCE_S = 300.0
_HELD_S = 10.0
_TRIES = 3
_LOOK_S = 0.5
_SESSION = (
    ('operate enable', r'ENABLED, session-\d+'),
    ('operate calibrate', r'(?s)class .* deg with probability .*bend_y can be bent from'),
    ('topics', r'motor/measured_js'),
    ('topics --echo motor/measured_js --once', r'motor_x'),
    ('operate set console.source motion', r'console.source = motion, was none'),
    ('operate set compensator.mode physical', r'compensator.mode = physical'),
    ('operate status', r'ENABLED'),
    ('operate home', r'home'),
    ('operate disable', r'DISABLED'),
)


@contextmanager
def busy_loops(n: int) -> Iterator[None]:
    """Let programs that never wait run beside; each is worth 1 of load."""
    loops = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(n)]
    try:
        # The load is an average over a minute.
        time.sleep(60.0 if n else 0.0)
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def shell_trial(folder: Path, domain: int) -> str:
    """Go through the session of README; the first step that failed and what it said, or empty."""
    environment = os.environ | {'ROS_DOMAIN_ID': str(domain)}
    log = folder / 'graph.log'
    with log.open('w') as file:
        graph = subprocess.Popen(
            [Path(sys.executable).with_name('graph')],
            cwd=folder,
            env=environment,
            stdout=file,
            stderr=subprocess.STDOUT,
        )
    try:
        end = time.monotonic() + _PATIENCE_S
        while 'ready in' not in log.read_text():
            if time.monotonic() > end or graph.poll() is not None:
                return f'graph does not get ready: {log.read_text()[-300:]!r}'
            time.sleep(_LOOK_S)
        for words, expected in _SESSION:
            done = subprocess.run(
                [sys.executable, '-m', 'endoscope_bringup.cli', *words.split()],
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=_PATIENCE_S,
            )
            said = done.stdout + done.stderr
            if done.returncode or not re.search(expected, said):
                return f'{words}: exit {done.returncode}, {said[-300:]!r}'
        graph.send_signal(signal.SIGINT)
        status = graph.wait(_PATIENCE_S)
        return f'graph: exit {status}' if status else ''
    finally:
        if graph.poll() is None:
            graph.kill()
            graph.wait()


def console_trial(folder: Path, domain: int) -> str:
    """Go through the steps of the console's guide; what failed, or empty."""
    try:
        with Relay() as network, ServedConsole(folder, domain, (network.address,)) as console:
            network.target = console.port
            client = console.client
            with Hand(console, network) as hand:
                hand.take_controls(enable=False)
                _hold_until(hand, 'KeyE', lambda: client.state == 'ENABLED')
                console.until(lambda: client.state == 'ENABLED', 'ENABLED', _PATIENCE_S)
                _hold_until(hand, 'KeyC', lambda: bool(client.underway or client.calibration))
                console.until(lambda: client.calibration is not None, 'a result', _PATIENCE_S)
                for _ in range(3):
                    hand.move()
                    console.passes(2.0)
                    hand.let_go()
                    console.passes(2.0)
                if client.state != 'ENABLED':
                    return f'{client.state}: {client.why}'
                client.home(_PATIENCE_S)
                client.ask('disable')
    except (BrowserError, ConsoleError, GraphError) as error:
        return str(error)[:600]
    return ''


def _hold_until(hand: Hand, code: str, begun: Callable[[], bool]) -> None:
    """Hold a key as the guide says until it is seen to act; once more where it did not."""
    for _ in range(_TRIES):
        hand.press(code)
        acts = hand.console.client.wait_until(begun, _HELD_S)
        hand.let_go()
        if acts:
            return


def long_motion(folder: Path, domain: int, seconds: float) -> tuple[str, str]:
    """Play a motion, recorded, with the page open in Chromium; the fault, if any, and figures."""
    factors, trouble = [], ''
    with Relay() as network, ServedConsole(folder, domain, (network.address,)) as console:
        network.target = console.port
        client = console.client
        with Hand(console, network):
            client.ask('enable')
            set_parameters(client, 'console', {'source': 'motion'})
            end = time.monotonic() + seconds
            while time.monotonic() < end and not trouble:
                console.passes(1.0)
                factors.append(client.factor or 0.0)
                if client.state != 'ENABLED':
                    trouble = f'{client.state}: {client.why}'
            health = client.health['recorder: recording']
            client.ask('disable')
    factors.sort()
    messages, lost = (int(float(health.values[key])) for key in ('messages', 'lost'))
    return trouble, (
        f'{lost} lost of {messages}, real-time factor {factors[0]:.2f} to {factors[-1]:.2f}, '
        f'median {factors[len(factors) // 2]:.2f}'
    )
