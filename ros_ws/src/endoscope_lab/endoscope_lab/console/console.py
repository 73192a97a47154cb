"""`endoscope bench console`: time until the slave stops after an event on the page."""

import argparse
import math
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from endoscope_lab.bench import (
    require_known,
    spread,
    table_head,
    table_row,
    today_and_machine,
)
from endoscope_lab.console.events import EVENTS, EventResponse, undergo
from endoscope_lab.console.hand import Hand
from endoscope_lab.console.relay import Relay
from endoscope_lab.console.served_console import SAME_RAD, ServedConsole
from endoscope_nodes.runtime.private_domain import private_domain

_USUAL = ('dead-man let go', 'tab closed', 'network silent', 'network cut')
_COLUMNS = (
    'event',
    'N',
    'to the last change of motor/servo_jp [ms] median, 99 %, largest',
    'to clutch 0 [ms] median, 99 %, largest',
    'over 150 ms',
    'crept afterwards [mrad]',
    'load',
)
_AIM_MS = 150.0
# Without load, the last message of a motion comes within 0.05 s of the one that ends it.
_SETTLED_S, _WATCHED_S = 0.3, 0.3


def run(args: argparse.Namespace) -> int:
    """Print a row for each event and a line for each other figure; return 1 if something crept."""
    names = tuple(EVENTS) if args.only == ['all'] else tuple(args.only or _USUAL)
    require_known('event', names, EVENTS)
    print(f'{"real" if args.real_time else "simulated"} time, {today_and_machine()}', flush=True)
    crept = 0
    began_s = time.monotonic()
    with (
        tempfile.TemporaryDirectory() as folder,
        Relay() as network,
        ServedConsole(
            Path(folder), private_domain(), (network.address,), real_time=args.real_time
        ) as console,
    ):
        network.target = console.port
        with Hand(console, network) as hand:
            print(f'{first_motion(hand, began_s)}\n', flush=True)
            if args.repetitions:
                print(table_head(*_COLUMNS), flush=True)
            for name in names if args.repetitions else ():
                crept += _trials(name, hand, args.repetitions)
            if args.inputs:
                print()
                for line in input_latency(hand, args.inputs):
                    print(line, flush=True)
    return 1 if crept else 0


def _trials(name: str, hand: Hand, repetitions: int) -> int:
    """Repeat an event and print its row; return how often something crept."""
    outcomes: list[EventResponse] = []
    try:
        for k in range(repetitions):
            print(f'\r{name} {k + 1} of {repetitions}', end='', file=sys.stderr, flush=True)
            outcomes.append(undergo(EVENTS[name], hand, _SETTLED_S, _WATCHED_S))
            EVENTS[name].is_over(hand)
    finally:
        # Hours of trials are not lost when the browser ends.
        print('\r\x1b[K', end='', file=sys.stderr)
        if outcomes:
            print(_row(name, outcomes), flush=True)
    return sum(outcome.crept > SAME_RAD for outcome in outcomes)


def _in_ms(values: Sequence[float]) -> str:
    return ', '.join(f'{each:.0f}' for each in spread(values))


def _row(name: str, outcomes: Sequence[EventResponse]) -> str:
    loads = [outcome.load for outcome in outcomes]
    return table_row(
        name,
        len(outcomes),
        _in_ms([max(0.0, outcome.last_change_ms) for outcome in outcomes]),
        _in_ms([outcome.clutch_ms for outcome in outcomes]),
        sum(max(o.clutch_ms, o.last_change_ms) > _AIM_MS for o in outcomes),
        f'{1e3 * max(outcome.crept for outcome in outcomes):.1f}',
        f'{min(loads):.0f} to {max(loads):.0f}',
    )


_STILL_S = 0.3
_PAINTED = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"


def first_motion(hand: Hand, began_s: float) -> str:
    """Line on the time from the program's start, by the monotonic clock, to a moving slave."""
    # The hand's browser started once all nodes published.
    hand.move()
    took_s = time.monotonic() - began_s
    painted_ms = hand.tab.value(_PAINTED)
    hand.let_go()
    return (
        f'from the start of the program, and of a browser when its graph runs, to a slave in '
        f'motion {took_s:.1f} s; first paint of the page {painted_ms:.0f} ms'
    )


def input_latency(hand: Hand, inputs: int) -> Iterator[str]:
    """Lines on the latency from a key to the handle, and to ``motor/servo_jp``."""
    # Before each input, the operator holds Space and the slave is at rest.
    console = hand.console
    took_ms: dict[str, list[float]] = {'master/measured_js': [], 'motor/servo_jp': []}
    while min(map(len, took_ms.values())) < inputs:
        console.forget()
        hand.let_go()
        hand.hold('Space')
        console.passes(_STILL_S)
        if hand.moves:
            continue
        goals = console.motors.angles
        key = 'ArrowLeft' if goals and goals[-1][0] > 0.0 else 'ArrowRight'
        at_ns = time.time_ns()
        hand.press(key)
        console.passes(_STILL_S)
        first = [heard.first_change_ms(at_ns) for heard in (console.handle, console.motors)]
        if not any(map(math.isnan, first)):
            for took, ms in zip(took_ms.values(), first, strict=True):
                took.append(ms)
    hand.let_go()
    for topic, took in took_ms.items():
        median, most, _ = spread(took)
        yield (
            f'key to {topic}, {inputs} inputs: median {median:.0f} ms, 99 % {most:.0f} ms, '
            f'load average {os.getloadavg()[0]:.1f}'
        )
