"""`endoscope console` beside the simulated graph, and its page under the hands of an operator."""

import re
import signal
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import pytest
from operated_graph import OperatedGraph
from playwright.sync_api import Browser, Page, expect
from simulated_graph import TICK_RATE

PATIENCE_MS = 60_000
"""For whatever the page is to show: a busy machine shows it late, and that is no fault here."""
expect.set_options(timeout=PATIENCE_MS)
_LONGEST_S = 60.0
_STILL_S = 0.5
_HEARD_NS = 50_000_000
"""Within which a node acts upon what another has heard."""
_GRIP_S = 5.0
_SHARE = "(button) => button.style.getPropertyValue('--share')"
_WATCH_POLICY = """
document.addEventListener('securitypolicyviolation', (event) =>
  console.error(`policy: ${event.violatedDirective} ${event.blockedURI}`));
"""


class BrowsedConsole:
    """The graph in a thread of its own, no faster than real time, and the server of its page.

    Attributes
    ----------
    address
        Of the page.
    operator, viewer
        Tokens.
    folder
        Of recordings.
    """

    def __init__(self, folder) -> None:
        self.folder = folder
        # What it leaves of a core is the browser's.
        self.graph = OperatedGraph(folder, tick_rate=TICK_RATE)
        self._goes_on = True
        self._thread = ThreadPoolExecutor(1)
        self._pacing = self._thread.submit(self._live)
        self._process: subprocess.Popen | None = None
        self._port = 0
        self.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()
        self._goes_on = False
        self._thread.shutdown()
        self._pacing.result()
        self.graph.close()

    def _live(self) -> None:
        self.graph.pace()
        if self._goes_on:
            # Behind what it was asked meanwhile.
            self._pacing = self._thread.submit(self._live)

    def ask[T](self, ask: Callable[[OperatedGraph], T]) -> T:
        """Have the graph's own thread do something with it."""
        return self._thread.submit(ask, self.graph).result(_LONGEST_S)

    def start(self) -> None:
        """Start the server, at the address that it had before."""
        self._process = self.graph.start(
            *('console', '--no-graph', '--port', str(self._port)),
            *('--token-file', str(self.folder / 'tokens'), '--bags', str(self.folder)),
        )
        output = ''
        for _ in range(2):
            output += self._process.stdout.readline()
        found = re.findall(r'(http://127\.0\.0\.1:(\d+))/#token=(\S+)', output)
        assert len(found) == 2, output + self._process.stderr.read()
        (self.address, port, self.operator), (_, _, self.viewer) = found
        self._port = int(port)

    def end(self) -> None:
        """End the server as Ctrl-C does."""
        self._process.send_signal(signal.SIGINT)
        try:
            assert self._process.wait(_LONGEST_S) == 0, self._process.stderr.read()
        finally:
            self._process.kill()
            self._process.communicate()

    @property
    def now_ns(self) -> int:
        return self.graph.clock.now_ns

    def moved(self, since_ns: int) -> float:
        """How far the goals of the motors have been moved since then, rad."""
        goals = [g.position for g in list(self.graph.goals) if g.stamp_ns > since_ns]
        return float(np.ptp(goals, axis=0).max()) if goals else 0.0

    def stands(self, page: Page) -> bool:
        """Whether nothing moves for half a second, once the graph has heard of the release."""
        until(page, lambda: not any(list(self.graph.clutches)[-1:]))
        begin = self.now_ns + _HEARD_NS
        until(page, lambda: self.now_ns > begin + _STILL_S * 1e9)
        return self.moved(begin) < 1e-9

    @contextmanager
    def page(self, browser: Browser, token: str | None = None, script: str = '', **how):
        """A page of the operator, whose complaints are errors."""
        how = {'viewport': {'width': 1440, 'height': 900}} | how
        with browser.new_context(**how) as context:
            page = context.new_page()
            complaints: list[str] = []
            page.on('console', lambda m: complaints.append(f'{m.type}: {m.text}'))
            page.on('pageerror', lambda error: complaints.append(str(error)))
            page.complaints = complaints
            page.set_default_timeout(PATIENCE_MS)
            page.add_init_script(_WATCH_POLICY + script)
            page.goto(f'{self.address}/#token={token or self.operator}')
            shows(page, 'state', re.compile('^(DISABLED|ENABLED|PAUSED|FAULT)$'))
            yield page
            assert complaints == []


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    with BrowsedConsole(tmp_path_factory.mktemp('browsed')) as console:
        yield console


@pytest.fixture
def console(running):
    """Nobody operates, and the slave is limp."""
    running.ask(lambda graph: graph.command('disable'))
    return running


@pytest.fixture
def page(console, browser):
    """Without plots, which a busy machine draws too slowly for a hand to be trusted."""
    with console.page(browser, viewport={'width': 1024, 'height': 768}) as page:
        yield page


def shows(page: Page, name: str, words) -> None:
    """Wait for words in an element."""
    expect(page.locator(f'#{name}')).to_have_text(words)


def until(page: Page, condition: Callable[[], bool], what: str = 'it') -> None:
    """Let the page go on until something has come true."""
    end = time.monotonic() + _LONGEST_S
    while not condition():
        shown = page.locator('#next').inner_text()
        assert time.monotonic() < end, f'{what} does not come; the page says {shown!r}'
        page.wait_for_timeout(20)


def hold(page: Page, name: str) -> None:
    """Hold a button of the page by the mouse, until it has acted."""
    button = page.locator(f'#{name}')
    expect(button).to_be_enabled()
    box = button.bounding_box()
    page.mouse.move(box['x'] + box['width'] / 2, box['y'] + box['height'] / 2)
    page.mouse.down()
    try:
        # It acts when it is full, and mostly cannot be pressed any more then.
        until(page, lambda: button.is_disabled() or button.evaluate(_SHARE) == '1', name)
    finally:
        page.mouse.up()


def take(page: Page) -> None:
    """Take the controls."""
    page.click('#claim')
    shows(page, 'operator', 'you')


def enable(page: Page) -> None:
    """Take the controls and enable, up to where the hand is waited for."""
    if page.locator('#operator').inner_text() != 'you':
        take(page)
    hold_enable(page)


def hold_enable(page: Page) -> None:
    """Hold Enable or Resume; anew where it came too soon, or where a stall has undone it."""
    end = time.monotonic() + _LONGEST_S
    button = page.locator('#enable')
    while True:
        until(page, lambda: button.is_enabled() or _is_enabled(page), 'Enable')
        if _is_enabled(page):
            return
        assert time.monotonic() < end, f'refused: {page.locator("#answer").inner_text()}'
        hold(page, 'enable')
        soon = time.monotonic() + _GRIP_S
        while time.monotonic() < soon and not _is_enabled(page):
            page.wait_for_timeout(20)


def _is_enabled(page: Page) -> bool:
    return page.locator('#state').inner_text() == 'ENABLED'


def grip(page: Page, press: Callable[[], None], release: Callable[[], None], done) -> None:
    """Take hold until something has come true; anew where a stall of the machine has ended it."""
    end = time.monotonic() + _LONGEST_S
    while time.monotonic() < end:
        # A machine that stood still for 2 s has lost him the controls.
        enable(page)
        until(page, lambda: page.locator('body').get_attribute('data-ready') == 'true', 'readiness')
        press()
        slot = time.monotonic() + _GRIP_S
        while time.monotonic() < slot:
            if done():
                return
            if page.locator('body').get_attribute('data-step') == '4':
                break
            page.wait_for_timeout(20)
        release()
    raise AssertionError(f'nothing follows: {page.locator("#lamp-why").inner_text()}')
