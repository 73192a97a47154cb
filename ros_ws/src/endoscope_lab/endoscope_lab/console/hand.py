"""An operator at the page in a browser: takes the controls, holds keys, and releases them."""

import time
from contextlib import suppress
from typing import Any

from endoscope_core.exit_status import ClosedOnExit
from endoscope_lab.console.chromium import BrowserError, Chromium, Tab
from endoscope_lab.console.relay import Relay
from endoscope_lab.console.served_console import PAGE_PATIENCE_S, ServedConsole

_MOVING_NS = 60_000_000
_LOOK_S = 0.05
_ANSWERED_S = 0.5
# After this time without following, a busy machine has released the clutch.
_FOLLOWED_S = 2.0
_LAMP = "document.getElementById('lamp')?.textContent"
_STEP = 'document.body?.dataset.step'
# Steps: calibrate, which is optional, and hold and move.
_MAY_MOVE = ('3', '5')
_CLAIM = "document.getElementById('claim')"
_MINE = f'{_CLAIM}?.textContent === "Give back"'
_FREE = f'{_CLAIM}?.textContent === "Take the controls" && !{_CLAIM}.disabled'
_ANSWER = "document.getElementById('answer')?.textContent"
_TEXT = 'document.body?.innerText'


class Hand(ClosedOnExit):
    """An operator at a page, with a network between the page and its console."""

    def __init__(self, console: ServedConsole, network: Relay) -> None:
        self.console = console
        self.network = network
        self._address = f'{network.address}/#token={console.token}'
        # Ids of the processes that ran pages when the slave was last set in motion.
        self.page_processes: list[int] = []
        self.browser = Chromium()
        self._held: list[str] = []
        self._open()

    def _open(self) -> None:
        self.tab: Tab = self.browser.tab(self._address)

    def renew_tab(self) -> None:
        """Open the page in another tab, keys still down."""
        self._open()

    def renew_browser(self) -> None:
        """Open the page in another browser, keys still down."""
        self.browser.close()
        self.browser = Chromium()
        self.renew_tab()

    def _seen(self, expression: str) -> Any:
        """Value of an expression; None in a page that is being replaced."""
        with suppress(BrowserError):
            return self.tab.value(expression)
        return None

    def take_controls(self, enable: bool = True) -> None:
        """Take the controls, and enable the slave if wanted."""
        self.let_go()
        end = time.monotonic() + PAGE_PATIENCE_S
        answer = ''
        while not self._seen(_MINE):
            if time.monotonic() > end:
                raise BrowserError(f'the page does not get the controls: {answer}')
            if self._seen(_FREE):
                self._seen(f'{_CLAIM}.click()')
                self.console.passes(_ANSWERED_S)
                answer = self._seen(_ANSWER) or answer
            self.console.passes(_LOOK_S)
        client = self.console.client
        if enable and client.state != 'ENABLED':
            client.ask('resume' if client.state == 'PAUSED' else 'enable')

    def press(self, code: str) -> None:
        """Press a key and keep it down."""
        self.tab.key(code, True)
        self._held.append(code)

    def repeats(self) -> None:
        """Repeat the keys that are down, as a keyboard does."""
        for code in self._held:
            self.tab.key(code, True, repeats=True)

    def let_go(self) -> None:
        for code in reversed(self._held):
            self.tab.key(code, False)
        self._held = []

    def hold(self, *codes: str) -> None:
        """Hold keys until the lamp shows that the slave follows; retry if it does not."""
        end = time.monotonic() + PAGE_PATIENCE_S
        since = -_FOLLOWED_S
        while self._seen(_LAMP) != 'FOLLOWING':
            now = time.monotonic()
            if now > end:
                raise BrowserError(f'not followed: {self.tab.value(_TEXT)!r}')
            if self._held and now - since > _FOLLOWED_S:
                self.let_go()
            elif not self._held:
                # The controls may have been lost meanwhile.
                self.take_controls()
                if self._seen(_STEP) in _MAY_MOVE:
                    for code in codes:
                        self.press(code)
                    since = now
            self.console.passes(_LOOK_S)

    def move(self) -> None:
        """Hold keys until the slave moves, towards the middle or away from it."""
        last = time.monotonic() + PAGE_PATIENCE_S
        while time.monotonic() < last:
            goals = self.console.motors.angles
            outside = bool(goals) and goals[-1][0] > 0.0
            self.hold('Space', 'ArrowLeft' if outside else 'ArrowRight')
            end = time.monotonic() + _FOLLOWED_S
            while time.monotonic() < end:
                self.console.passes(_LOOK_S)
                if self.moves:
                    self.page_processes = self.browser.page_processes()
                    return
            self.let_go()
        raise BrowserError('the slave follows and does not move')

    def follow_link(self) -> None:
        """Follow a link to another, empty site."""
        self.tab.post('Page.navigate', url=f'http://localhost:{self.console.port}/')

    @property
    def moves(self) -> bool:
        """Whether the clutch is held and the latest goals of the shafts change."""
        console = self.console
        console.client.hear()
        changes = console.motors.changes_ns()
        held = bool(console.clutches) and console.clutches[-1][1]
        fresh = bool(changes.size) and console.motors.at_ns[-1] - int(changes[-1]) < _MOVING_NS
        return held and fresh

    def close(self) -> None:
        self.browser.close()
