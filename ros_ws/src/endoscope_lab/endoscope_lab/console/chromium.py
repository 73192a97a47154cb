"""The installed Chromium without a window, controlled by its DevTools protocol.

Test frameworks keep their pages in front, focused and at full speed. A page that is hidden, frozen
or killed, as on a desktop, needs the protocol itself.
"""

import itertools
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from endoscope_core.errors import EndoscopeError
from endoscope_core.exit_status import ClosedOnExit

_ARGUMENTS = (
    *('--headless=new', '--no-sandbox', '--no-first-run', '--disable-extensions'),
    *('--remote-debugging-port=0', '--window-size=1440,900'),
)
_BROWSER_PATIENCE_S = 60.0
_LOOK_S = 0.02
KEYS = {
    'Space': (' ', 32),
    'ArrowLeft': ('ArrowLeft', 37),
    'ArrowRight': ('ArrowRight', 39),
    'KeyC': ('c', 67),
    'KeyE': ('e', 69),
    'KeyH': ('h', 72),
}
"""Keys by their place on the keyboard: key value and key code."""


class BrowserError(EndoscopeError, RuntimeError):
    """The browser is missing, does not answer, or refuses a command."""


class Chromium(ClosedOnExit):
    """A browser with a temporary profile of its own; BrowserError if it does not start."""

    def __init__(self) -> None:
        program = shutil.which('chromium')
        if program is None:
            raise BrowserError('no chromium here: apt install chromium fonts-dejavu-core')
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._process = subprocess.Popen(
            [program, *_ARGUMENTS, f'--user-data-dir={self._folder.name}', 'about:blank'],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._numbers = itertools.count(1)
        try:
            self._socket = self._connected()
        except BaseException:
            self.kill()
            self._folder.cleanup()
            raise

    def _connected(self) -> ClientConnection:
        place = Path(self._folder.name) / 'DevToolsActivePort'
        end = time.monotonic() + _BROWSER_PATIENCE_S
        while not (place.exists() and len(lines := place.read_text().splitlines()) == 2):
            if self._process.poll() is not None or time.monotonic() > end:
                raise BrowserError(f'chromium does not start; its status is {self._process.poll()}')
            time.sleep(_LOOK_S)
        address = f'ws://127.0.0.1:{lines[0]}{lines[1]}'
        return connect(address, max_size=None, compression=None, legacy=True)

    def post(self, method: str, session: str = '', **parameters: Any) -> int:
        """Send a command without waiting for the answer; return its number."""
        number = next(self._numbers)
        message = {'id': number, 'method': method, 'params': parameters}
        self._socket.send(json.dumps(message | ({'sessionId': session} if session else {})))
        return number

    def call(self, method: str, session: str = '', **parameters: Any) -> dict[str, Any]:
        """Send a command to the browser or to a session's tab; BrowserError if it is refused."""
        number = self.post(method, session, **parameters)
        end = time.monotonic() + _BROWSER_PATIENCE_S
        while True:
            try:
                answer = json.loads(self._socket.recv(timeout=max(0.0, end - time.monotonic())))
            except (TimeoutError, ConnectionClosed) as error:
                raise BrowserError(f'chromium does not answer {method}: {error}') from error
            if answer.get('id') == number:
                break
        if 'error' in answer:
            raise BrowserError(f'{method}: {answer["error"]["message"]}')
        return dict(answer['result'])

    def tab(self, address: str) -> 'Tab':
        """Open an address in a tab in front of all others."""
        return Tab(self, address)

    def close_others(self, tab: 'Tab') -> None:
        for target in self.call('Target.getTargets')['targetInfos']:
            if target['type'] == 'page' and target['targetId'] != tab.target:
                self.call('Target.closeTarget', targetId=target['targetId'])

    def page_processes(self) -> list[int]:
        """Ids of the processes that run pages."""
        found = self.call('SystemInfo.getProcessInfo')['processInfo']
        return [process['id'] for process in found if process['type'] == 'renderer']

    def kill(self) -> None:
        """End it at once, as the kernel does when memory is short."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def close(self) -> None:
        self._socket.close()
        self.kill()
        self._folder.cleanup()


class Tab:
    """A tab."""

    def __init__(self, browser: Chromium, address: str) -> None:
        self._browser = browser
        self.target: str = browser.call('Target.createTarget', url=address)['targetId']
        attached = browser.call('Target.attachToTarget', targetId=self.target, flatten=True)
        self._session: str = attached['sessionId']
        self.to_front()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command to the tab, as :meth:`Chromium.call`."""
        return self._browser.call(method, self._session, **parameters)

    def post(self, method: str, **parameters: Any) -> None:
        """Send a command to the tab without waiting for the answer."""
        self._browser.post(method, self._session, **parameters)

    def to_front(self) -> None:
        """Put it in front of all others."""
        self._browser.call('Target.activateTarget', targetId=self.target)

    def key(self, code: str, down: bool, *, repeats: bool = False) -> None:
        """Press, repeat or release a key of :data:`KEYS`."""
        key, number = KEYS[code]
        self.call(
            'Input.dispatchKeyEvent',
            type='rawKeyDown' if down else 'keyUp',
            code=code,
            key=key,
            windowsVirtualKeyCode=number,
            autoRepeat=repeats,
        )

    def value(self, expression: str) -> Any:
        """Value of an expression, or of its promise, in the page; BrowserError if it throws."""
        answer = self.call(
            'Runtime.evaluate', expression=expression, returnByValue=True, awaitPromise=True
        )
        if 'exceptionDetails' in answer:
            raise BrowserError(f'{expression}: {answer["exceptionDetails"]}')
        return answer['result'].get('value')

    def minimise(self, minimised: bool = True) -> None:
        """Minimise the window, or restore it."""
        window = self._browser.call('Browser.getWindowForTarget', targetId=self.target)
        state = 'minimized' if minimised else 'normal'
        self._browser.call(
            'Browser.setWindowBounds', windowId=window['windowId'], bounds={'windowState': state}
        )

    def close(self) -> None:
        self._browser.call('Target.closeTarget', targetId=self.target)
