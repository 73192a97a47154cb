"""A load-cell transmitter with pymodbus's own server and simulated device, in a thread."""

import asyncio
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from endoscope_core.exit_status import ClosedOnExit

# Registers from 0 on at a time in s since the start; None while the device is busy.
RegisterSource = Callable[[float], Sequence[int] | None]


class TransmitterEmulator(ClosedOnExit):
    """Serves registers by Modbus, each reading anew from ``source``.

    Protocol and server are pymodbus's; what a test chooses is the registers' content. Without a
    serial port for RTU, a TCP port of this machine is served.
    """

    def __init__(
        self,
        source: RegisterSource,
        registers: int,
        *,
        unit: int = 1,
        serial_port: str = '',
        tcp_port: int = 0,
    ) -> None:
        self.source = source
        self.tcp_port = tcp_port  # where it listens; 0 at first for any that is free
        self._registers = registers
        self._unit = unit
        self._serial_port = serial_port
        self._started = threading.Event()
        self._start_s = time.monotonic()
        self._loop = asyncio.new_event_loop()
        self._server: ModbusSerialServer | ModbusTcpServer | None = None
        self._thread = threading.Thread(target=self._run, name='transmitter', daemon=True)
        self._thread.start()
        self._started.wait()

    async def _refresh(
        self,
        _function: int,
        _start: int,
        _address: int,
        _count: int,
        current: list[int],
        _values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        words = self.source(time.monotonic() - self._start_s)
        if words is None:
            return ExcCodes.DEVICE_BUSY
        current[: len(words)] = [word & 0xFFFF for word in words]
        return None

    async def _serve(self) -> None:
        device = SimDevice(
            id=self._unit,
            simdata=[SimData(0, count=self._registers, values=0, datatype=DataType.REGISTERS)],
            action=self._refresh,
        )
        if self._serial_port:
            self._server = ModbusSerialServer(device, port=self._serial_port, baudrate=115200)
        else:
            self._server = ModbusTcpServer(device, address=('127.0.0.1', self.tcp_port))
        await self._server.serve_forever(background=True)
        if not self._serial_port:
            listener: Any = self._server.transport
            self.tcp_port = listener.sockets[0].getsockname()[1]
        self._started.set()
        await self._server.serving

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._started.set()

    def close(self) -> None:
        """Stop serving: open connections are closed, as when the device loses its power."""
        if self._server is not None and self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result()
        self._thread.join()
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()
