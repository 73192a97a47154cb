"""A network between page and server that can fall silent or be cut."""

import selectors
import socket
import struct
import threading
import time
from contextlib import suppress
from typing import cast

from endoscope_core.exit_status import ClosedOnExit

_LOOK_S = 0.01
_BLOCK = 65536
_AT_ONCE = struct.pack('ii', 1, 0)


class Relay(ClosedOnExit):
    """Forwards TCP connections of 127.0.0.1 to a port, both ways."""

    def __init__(self) -> None:
        self._listening = socket.create_server(('127.0.0.1', 0))
        self.port: int = self._listening.getsockname()[1]
        self.target = 0  # port to which it forwards
        self.silent = False  # forwards nothing, so that data arrive late
        self._open = True
        self._cut = False
        self._peers: dict[socket.socket, socket.socket] = {}
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listening, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name='relay', daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Address of the page through the relay."""
        return f'http://127.0.0.1:{self.port}'

    def cut(self) -> None:
        """Reset every connection, as a router does when it is switched off and on."""
        self._cut = True

    def _run(self) -> None:
        while self._open:
            if self._cut:
                self._cut = False
                for side in list(self._peers):
                    self._end(side)
            if self.silent:
                time.sleep(_LOOK_S)
                continue
            for key, _ in self._selector.select(_LOOK_S):
                side = cast(socket.socket, key.fileobj)
                if side is self._listening:
                    self._accept()
                elif side in self._peers:
                    self._pass_on(side)

    def _accept(self) -> None:
        near, _ = self._listening.accept()
        try:
            far = socket.create_connection(('127.0.0.1', self.target))
        except OSError:
            near.close()
            return
        for side, peer in ((near, far), (far, near)):
            side.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._peers[side] = peer
            self._selector.register(side, selectors.EVENT_READ)

    def _pass_on(self, side: socket.socket) -> None:
        try:
            data = side.recv(_BLOCK)
            self._peers[side].sendall(data)
        except OSError:
            data = b''
        if not data:
            self._end(side)

    def _end(self, side: socket.socket) -> None:
        if side not in self._peers:
            return
        for end in (side, self._peers[side]):
            del self._peers[end]
            self._selector.unregister(end)
            with suppress(OSError):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
            end.close()

    def close(self) -> None:
        self._open = False
        self._thread.join()
        for side in list(self._peers):
            self._end(side)
        self._listening.close()
        self._selector.close()
