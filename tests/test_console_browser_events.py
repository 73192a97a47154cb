"""Whatever happens to the page of an operator who holds on, the slave stops and stays there.

Some of it is tried each night alone: it ends a grip in a way that another of them does, too.
"""

import time

import pytest
from simulated_graph import TICK_RATE

from endoscope_lab.console.events import EVENTS, undergo
from endoscope_lab.console.hand import Hand
from endoscope_lab.console.relay import Relay
from endoscope_lab.console.served_console import SAME_RAD, ServedConsole
from endoscope_nodes.runtime.private_domain import private_domain

SETTLED_S, WATCHED_S = 1.0, 0.5
DAILY = ('page process stopped', 'network silent')


@pytest.fixture(scope='module')
def hand(tmp_path_factory):
    folder = tmp_path_factory.mktemp('console')
    with (
        Relay() as network,
        ServedConsole(
            folder, private_domain(), (network.address,), graph=f'-p tick_rate:={TICK_RATE}'
        ) as console,
    ):
        network.target = console.port
        with Hand(console, network) as hand:
            yield hand


@pytest.mark.parametrize(
    'name',
    [
        *DAILY,
        *(pytest.param(name, marks=pytest.mark.nightly) for name in EVENTS if name not in DAILY),
    ],
)
def test_it_stops_the_slave_and_nothing_moves_without_a_new_grip(hand, name):
    console, event = hand.console, EVENTS[name]
    outcome = undergo(event, hand, SETTLED_S, WATCHED_S)
    assert outcome.crept <= SAME_RAD
    # The page is there again, and the operator has held on all the time.
    over_ns = time.time_ns()
    event.is_over(hand)
    console.passes(WATCHED_S)
    if name != 'dead-man let go':
        hand.repeats()
    console.passes(WATCHED_S)
    assert console.motors.travel_since(over_ns) <= SAME_RAD
    assert not any(held for at, held in console.clutches if at >= over_ns)
    # Without such a grip it would have passed, too.
    console.forget()
    hand.move()
    hand.let_go()
