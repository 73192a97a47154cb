"""Events on the page of an operator who holds a key, and the response of the motors."""

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass

from endoscope_lab.console.hand import Hand

_TRIES = 20
_RELEASED_S = 10.0


@dataclass(frozen=True)
class Halt:
    """An event that ends the motion."""

    # Triggers the event, without waiting for an answer.
    happens: Callable[[Hand], object]
    # Restores the page, or opens another one, for an operator who still holds the key.
    is_over: Callable[[Hand], object]


@dataclass(frozen=True)
class EventResponse:
    """Response to one event."""

    # From the event to the last change of ``motor/servo_jp``.
    last_change_ms: float
    clutch_ms: float  # from the event to the message that the clutch is free
    crept: float  # travel of a shaft's goal in the watched time, rad
    load: float  # load average of the machine


def _stay(hand: Hand) -> None:
    """Leave the page as it is."""


def _cover(hand: Hand) -> None:
    hand.browser.post('Target.createTarget', url='about:blank')


def _uncover(hand: Hand) -> None:
    hand.browser.close_others(hand.tab)
    hand.tab.to_front()


def _signalled(number: int) -> Callable[[Hand], None]:
    def send(hand: Hand) -> None:
        for process in hand.page_processes:
            os.kill(process, number)

    return send


def _freeze(hand: Hand) -> None:
    hand.tab.post('Page.setWebLifecycleState', state='frozen')


def _thaw(hand: Hand) -> None:
    hand.tab.post('Page.setWebLifecycleState', state='active')
    # The page counts as hidden until it comes to the front.
    hand.browser.call('Target.createTarget', url='about:blank')
    _uncover(hand)


def _silence(silent: bool) -> Callable[[Hand], None]:
    def set_silent(hand: Hand) -> None:
        hand.network.silent = silent

    return set_silent


def _replace_tab(hand: Hand) -> None:
    hand.tab.close()
    hand.renew_tab()


EVENTS = {
    'dead-man let go': Halt(lambda hand: hand.tab.key('Space', False), _stay),
    'another tab in front': Halt(_cover, _uncover),
    'window minimised': Halt(
        lambda hand: hand.tab.minimise(), lambda hand: hand.tab.minimise(False)
    ),
    'page frozen': Halt(_freeze, _thaw),
    'page crashed': Halt(lambda hand: hand.tab.post('Page.crash'), _replace_tab),
    'page process stopped': Halt(_signalled(signal.SIGSTOP), _signalled(signal.SIGCONT)),
    'browser killed': Halt(lambda hand: hand.browser.kill(), lambda hand: hand.renew_browser()),
    'tab closed': Halt(lambda hand: hand.tab.close(), lambda hand: hand.renew_tab()),
    'page reloaded': Halt(lambda hand: hand.tab.post('Page.reload'), _stay),
    'link followed': Halt(
        lambda hand: hand.follow_link(), lambda hand: hand.tab.value('history.back()')
    ),
    'network silent': Halt(_silence(True), _silence(False)),
    'network cut': Halt(lambda hand: hand.network.cut(), _stay),
}
"""Events by a short description."""


def undergo(event: Halt, hand: Hand, settled_s: float, watched_s: float) -> EventResponse:
    """Trigger an event while an operator holds the slave in motion."""
    # Changes within `settled_s` of the message on the clutch still belong to the motion; the motors
    # are watched for `watched_s` after that.
    console = hand.console
    for _ in range(_TRIES):
        console.forget()
        hand.move()
        # On a busy machine the clutch may have been released meanwhile.
        if hand.moves:
            break
    at_ns = time.time_ns()
    event.happens(hand)
    console.until(
        lambda: console.released_ns(at_ns) is not None, 'a clutch that is free', _RELEASED_S
    )
    released_ns = console.released_ns(at_ns) or at_ns
    settled_ns = released_ns + round(1e9 * settled_s)
    console.passes(settled_s + watched_s)
    changes = console.motors.changes_ns()
    before = changes[changes <= settled_ns]
    return EventResponse(
        last_change_ms=(int(before[-1]) - at_ns) * 1e-6,
        clutch_ms=(released_ns - at_ns) * 1e-6,
        crept=console.motors.travel_since(settled_ns),
        load=os.getloadavg()[0],
    )
