"""Connections within limits: so many at once, no half requests, no queue of old pictures."""

import asyncio
import socket
import time
from collections import Counter
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from endoscope_console.clients import (
    FRAMES_A_SECOND,
    HELLO_S,
    OF_A_KIND,
    UNANSWERED,
    FrameRate,
)

AT_ONCE = 3 * OF_A_KIND + 2 * UNANSWERED
"""Connections of any kind: both sockets of each page, and requests for files."""

# What waits in the kernel and in the transport is already old when it is read.
_SEND_BUFFER = 16_384
_WRITE_BUFFER = 4096


def limited(counts: Counter[str]) -> tuple[type[asyncio.Protocol], type[asyncio.Protocol]]:
    """Return the protocols of requests and of sockets, which count what they refuse."""

    class Requests(HttpToolsProtocol):
        """Requests: too many connections are cut, half a request is waited for 2 s."""

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            """Take a connection, or cut it."""
            super().connection_made(transport)
            if len(self.connections) > AT_ONCE:
                counts['refused: too many connections'] += 1
                transport.abort()
            else:
                self._patience = self.loop.call_later(HELLO_S, self._give_up)

        def _give_up(self) -> None:
            waits = self.transport.get_protocol() is self and self.cycle is None
            if waits and not self.transport.is_closing():
                counts['refused: no whole request'] += 1
                self.transport.abort()

        def connection_lost(self, exc: Exception | None) -> None:
            """Forget the connection."""
            super().connection_lost(exc)
            patience = getattr(self, '_patience', None)
            if patience is not None:
                patience.cancel()

    class Sockets(WebSocketsSansIOProtocol):
        """Sockets that hold little back: a slow reader is dropped pictures, not sent old ones."""

        def connection_made(self, transport: Any) -> None:
            """Take a connection."""
            super().connection_made(transport)
            transport.set_write_buffer_limits(high=_WRITE_BUFFER)
            plain = transport.get_extra_info('socket')
            plain.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
            self._rate = FrameRate(FRAMES_A_SECOND)

        def handle_ping(self) -> None:
            """Answer one of those that no message counts."""
            if self._passes():
                super().handle_ping()

        def handle_cont(self, event: Any) -> None:
            """Take a piece of a message."""
            if self._passes():
                super().handle_cont(event)

        def _passes(self) -> bool:
            if self.transport.is_closing() or not self._rate.exceeded(time.monotonic_ns()):
                return True
            counts['refused: too many frames'] += 1
            self.transport.abort()
            return False

        def keepalive_timeout(self) -> None:
            """Let go of who does not answer, and of what waits to be sent to him."""
            super().keepalive_timeout()
            self.transport.abort()

    return Requests, Sockets
