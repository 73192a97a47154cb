"""What a page of the console does, without a browser: both sockets, a hand at 50 Hz, orders."""

import json
import threading
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace

from page_frames import decode_telemetry, encode_input
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from endoscope_console.teleop.frames import InputFrame

PERIOD_S = 0.02
_PATIENCE_S = 60.0


@dataclass(frozen=True)
class Hand:
    """What the hand does now."""

    pressed: bool = False
    turbo: bool = False
    visible: bool = True
    focused: bool = True
    position_mode: bool = False
    source: int = 0
    x: float = 0.0
    y: float = 0.0


class Page:
    """Both sockets of a page, each read by a thread; a third one sends what the hand does.

    Attributes
    ----------
    hello
        Answer to the first words on the socket for commands.
    state
        As last received.
    picture
        The newest one.
    lost
        Messages about a lost lease.
    sends
        Whether frames of the hand are sent.
    closed
        Close code and reason of the socket for commands, once it is closed.
    """

    def __init__(self, address, token, *, origin=None, telemetry=True) -> None:
        self._sockets = ExitStack()
        self._threads = []
        self._answers = {}
        self._news = threading.Condition()
        self._id = self._seq = self._grip = 0
        self.state = {}
        self.states = []
        self.picture = None
        self.pictures = 0
        self.lost = []
        self.sends = True
        self.closed = None
        self.hand = Hand()
        self._open = True
        url = address.replace('http', 'ws', 1)
        origin = origin or address
        if telemetry:
            self.telemetry = self._connect(f'{url}/telemetry', origin, token)
            self.seen_hello = json.loads(self.telemetry.recv(timeout=_PATIENCE_S))
            self._start(self._watch, self.telemetry)
        self.command = self._connect(f'{url}/command', origin, token)
        self.hello = json.loads(self.command.recv(timeout=_PATIENCE_S))
        self.you = self.hello['you']
        self._grip = self.hello['grips']
        self._start(self._listen, self.command)
        self._start(self._send)

    def _connect(self, url, origin, token):
        socket = self._sockets.enter_context(connect(url, origin=origin, compression=None))
        socket.send(json.dumps({'op': 'hello', 'token': token}))
        return socket

    def _start(self, work, *words) -> None:
        thread = threading.Thread(target=work, args=words, daemon=True)
        thread.start()
        self._threads.append(thread)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _watch(self, socket) -> None:
        with suppress(ConnectionClosed):
            for message in socket:
                with self._news:
                    if isinstance(message, bytes):
                        self.picture = decode_telemetry(message)
                        self.pictures += 1
                    else:
                        self.state = json.loads(message)
                        self.states.append(self.state)
                    self._news.notify_all()

    def _listen(self, socket) -> None:
        try:
            for text in socket:
                message = json.loads(text)
                with self._news:
                    if message['op'] == 'answer':
                        self._answers[message['id']] = message
                    else:
                        self.lost.append(message)
                    self._news.notify_all()
        except ConnectionClosed:
            pass
        with self._news:
            self.closed = socket.close_code, socket.close_reason
            self._news.notify_all()

    def _send(self) -> None:
        due = time.monotonic()
        while self._open and self.closed is None:
            if self.sends:
                self.send_frame()
            due = max(due + PERIOD_S, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))

    def send_frame(self, **other) -> None:
        """Send what the hand does, at once."""
        with self._news, suppress(ConnectionClosed):
            self._seq += 1
            values = {
                **self.hand.__dict__,
                'seq': self._seq,
                'grip': self._grip,
                'seen': self.picture.seq if self.picture else 0,
                't': time.monotonic(),
            }
            self.command.send(encode_input(InputFrame(**(values | other))))

    def does(self, **changes) -> None:
        """Have the hand do something else from now on, and say so at once."""
        with self._news:
            pressed = changes.get('pressed', self.hand.pressed)
            self._grip += pressed and not self.hand.pressed
            self.hand = replace(self.hand, **changes)
        self.send_frame()

    def begin(self, op, **fields) -> int:
        """Give an order and wait for nothing; its number."""
        with self._news:
            self._id += 1
            number = self._id
        self.command.send(json.dumps({'op': op, 'id': number, **fields}))
        return number

    def answer(self, number):
        """The answer to an order; None while there is none."""
        return self._answers.get(number)

    def wait(self, condition, seconds=_PATIENCE_S) -> bool:
        """Wait for something that comes by the sockets."""
        with self._news:
            return self._news.wait_for(condition, seconds)

    def order(self, op, **fields) -> dict:
        """Give an order and wait for the answer."""
        number = self.begin(op, **fields)
        assert self.wait(lambda: number in self._answers), (op, fields, self.closed)
        return self._answers[number]

    @property
    def dead_man(self) -> str:
        return self.state.get('dead_man', {}).get('state', '')

    def close(self) -> None:
        self._open = False
        self._sockets.close()
        for thread in self._threads:
            thread.join()
