"""A network cable: a TCP port that leads to another, with faults on the way."""

import socket
import threading

from endoscope_core.exit_status import ClosedOnExit
from endoscope_emulators.cables.byte_relay import ByteRelay, Tap, faithful


class TcpCable(ClosedOnExit):
    """Carries connections at a port of its own to a server on this machine."""

    def __init__(self, server_port: int) -> None:
        self.to_host: Tap = faithful  # what happens to bytes on the way; a test sets it
        self.to_device: Tap = faithful
        self._server_port = server_port
        self._listener = socket.create_server(('127.0.0.1', 0))
        self.port: int = self._listener.getsockname()[1]  # where to connect instead
        self._pairs: list[tuple[socket.socket, socket.socket, ByteRelay]] = []
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._accept, name='tcp cable', daemon=True)
        self._thread.start()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                # Closing the listener is the signal for this thread to end.
                return
            try:
                far = socket.create_connection(('127.0.0.1', self._server_port))
            except ConnectionRefusedError:
                near.close()
                continue
            relay = ByteRelay(near.fileno(), far.fileno(), self._tap)
            with self._lock:
                self._pairs.append((near, far, relay))

    def _tap(self, end: str) -> Tap:
        return self.to_device if end == 'near' else self.to_host

    def cut(self) -> None:
        """Close all connections that there are."""
        with self._lock:
            pairs, self._pairs = self._pairs, []
        for near, far, relay in pairs:
            relay.close()
            near.close()
            far.close()

    def close(self) -> None:
        """Close all connections and the port."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join()
        self.cut()
