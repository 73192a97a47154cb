"""Finds ports and servos, and advises what to change before they can be used."""

import errno
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from serial.tools import list_ports

from endoscope_devices.device import DeviceError
from endoscope_devices.dynamixel.control_table import (
    BAUD_CODES,
    CURRENT_LIMIT,
    GOAL_POSITION,
    HARDWARE_ERROR_STATUS,
    MODELS,
    OPERATING_MODE,
    PRESENT_INPUT_VOLTAGE,
    PRESENT_TEMPERATURE,
    RETURN_DELAY_TIME,
    TEMPERATURE_LIMIT,
    TORQUE_ENABLE,
    Register,
    hardware_errors_in_words,
)
from endoscope_devices.dynamixel.packet import STATUS_OVERHEAD
from endoscope_devices.dynamixel.packet_handler import (
    BusError,
    NoReplyError,
    PacketHandler,
    sync_read_request,
    sync_write_request,
)
from endoscope_devices.dynamixel.serial_port import BusPort, byte_time, latency_timer
from endoscope_devices.dynamixel.servo_block import BLOCK_ADDRESS, BLOCK_SIZE

# 'Specifications': 10.0 to 14.8 V; firmware: notes at Bus Watchdog(98) and 'Fast Sync Read'.
_VOLTAGE = (10.0, 14.8)
_WATCHDOG_FIRMWARE = 38
_WANTED_RATE = 1000.0
_WANTED_LATENCY_S = 1e-3
_NEAR_LIMIT_DEGC = 10
_ATTEMPTS = 3
"""Requests before a servo is considered silent: one reply may be lost on a busy computer."""


@dataclass
class ServoFinding:
    """Identity and state of a servo."""

    device: int
    baud: int  # speed in bit/s at which it was found
    model: str
    firmware: int
    voltage: float = 0.0  # V
    temperature: int = 0  # °C
    hardware: str = ''  # errors in words
    mode: int = 0
    current_limit: float = 0.0  # A
    return_delay: float = 0.0  # s
    torque: bool = False
    complete: bool = False  # whether all of this was read: it may answer a ping and then no more

    def __str__(self) -> str:
        known = f'  servo {self.device}: {self.model}, firmware {self.firmware}, {self.baud} baud'
        if not self.complete:
            return f'{known}; answers a ping; not all of its registers could be read'
        return (
            f'{known}, {self.voltage:.1f} V, {self.temperature} °C, '
            f'{self.hardware or "no hardware error"}\n'
            f'    operating mode {self.mode}, current limit {self.current_limit:.2f} A, '
            f'return delay {self.return_delay * 1e6:.0f} us, '
            f'torque {"on" if self.torque else "off"}'
        )


@dataclass
class PortFinding:
    """Servos and settings of a port."""

    port: str  # device file
    latency: float | None = None  # timer in s; None where the adapter has none
    servos: list[ServoFinding] = field(default_factory=list)
    advice: list[str] = field(default_factory=list)  # what to change, one line each

    def __str__(self) -> str:
        timer = 'none' if self.latency is None else f'{self.latency * 1e3:.0f} ms'
        lines = [f'{self.port}: latency timer {timer}, {len(self.servos)} servos']
        lines += map(str, self.servos)
        lines += (f'  change: {line}' for line in self.advice)
        return '\n'.join(lines)


def serial_ports() -> list[str]:
    """Device files of all serial adapters."""
    return sorted(port.device for port in list_ports.comports())


def examine(port: str, bauds: Sequence[int] = tuple(BAUD_CODES.values())) -> PortFinding:
    """Look for servos on a port at several speeds in bit/s, without changing anything."""
    finding = PortFinding(port, latency_timer(port))
    try:
        for baud in bauds:
            _listen(finding, baud)
    except DeviceError as error:
        finding.advice.append(_advice_for(port, error))
    except OSError as error:
        finding.advice.append(f'{port}: the adapter is gone ({error}); plug it in again')
    else:
        finding.advice += advise(finding)
    return finding


def reboot(port: str, baud: int, device: int) -> None:
    """Restart a servo, which ends its shutdown; DeviceError where it does not answer."""
    line = BusPort(port, baud)
    line.open()
    try:
        PacketHandler(line).reboot(device)
    finally:
        line.close()


def advise(finding: PortFinding) -> list[str]:
    """Return what to change at a port that could be opened."""
    advice = []
    if finding.latency is not None and finding.latency > _WANTED_LATENCY_S:
        name = Path(finding.port).resolve().name
        advice.append(
            f'latency timer: echo 1 | sudo tee /sys/class/tty/{name}/device/latency_timer'
        )
    if not finding.servos:
        return [*advice, 'no servo answers at any speed: check power, cable and adapter']
    speeds = sorted({servo.baud for servo in finding.servos})
    if len(speeds) > 1:
        advice.append(
            f'speeds {", ".join(map(str, speeds))}: give all servos of a bus the same Baud Rate(8)'
        )
    for servo in finding.servos:
        advice += (f'servo {servo.device}: {line}' for line in _advise_servo(servo))
    limit = cycles_per_second(speeds[0], len(finding.servos))
    if limit < _WANTED_RATE:
        advice.append(
            f'{speeds[0]} baud carries {limit:.0f} cycles a second of {len(finding.servos)} servos '
            f'({bytes_of_cycle(len(finding.servos))} bytes): set Baud Rate(8) to 3 (1 Mbaud) or '
            'more, and the parameter `baud` with it'
        )
    return advice


def _advise_servo(servo: ServoFinding) -> list[str]:
    advice = []
    if servo.model not in {model.name for model in MODELS.values()}:
        advice.append(f'{servo.model} is not one that the driver knows')
    if servo.firmware < _WATCHDOG_FIRMWARE:
        advice.append(
            f'firmware {servo.firmware} has no bus watchdog: update it to {_WATCHDOG_FIRMWARE} or '
            'newer'
        )
    if not servo.complete:
        return advice
    if servo.hardware:
        advice.append(
            f'{servo.hardware}: remove the cause, then '
            f'`endoscope doctor --reboot {servo.device} --baud {servo.baud}`'
        )
    if not _VOLTAGE[0] <= servo.voltage <= _VOLTAGE[1]:
        advice.append(
            f'supply of {servo.voltage:.1f} V: give {_VOLTAGE[0]:g} to {_VOLTAGE[1]:g} V, best 12'
        )
    if servo.temperature >= TEMPERATURE_LIMIT.initial - _NEAR_LIMIT_DEGC:
        advice.append(f'{servo.temperature} °C: let it cool')
    return advice


def _listen(finding: PortFinding, baud: int) -> None:
    line = BusPort(finding.port, baud)
    line.open()
    try:
        bus = PacketHandler(line)
        for device, (number, firmware) in sorted(bus.broadcast_ping().items()):
            model = MODELS[number].name if number in MODELS else f'model number {number}'
            servo = ServoFinding(device, baud, model, firmware)
            finding.servos.append(servo)
            try:
                _ask(bus, servo)
            except BusError as error:
                finding.advice.append(str(error))
    finally:
        line.close()


def _ask(bus: PacketHandler, servo: ServoFinding) -> None:
    def value(register: Register) -> float:
        for _ in range(_ATTEMPTS - 1):
            with suppress(NoReplyError):
                return bus.read_register(servo.device, register) * register.scale
        return bus.read_register(servo.device, register) * register.scale

    servo.voltage = value(PRESENT_INPUT_VOLTAGE)
    servo.temperature = int(value(PRESENT_TEMPERATURE))
    servo.hardware = hardware_errors_in_words(int(value(HARDWARE_ERROR_STATUS)))
    servo.mode = int(value(OPERATING_MODE))
    servo.current_limit = value(CURRENT_LIMIT)
    servo.return_delay = value(RETURN_DELAY_TIME)
    servo.torque = bool(value(TORQUE_ENABLE))
    servo.complete = True


def _advice_for(port: str, error: DeviceError) -> str:
    cause = error.__cause__
    if isinstance(cause, OSError) and cause.errno == errno.EACCES:
        return f'{port}: no permission: sudo usermod -a -G dialout $USER, and log in again'
    return str(error)


def bytes_of_cycle(servos: int) -> int:
    """Bytes of one sync write of goals and one sync read with its answers, unstuffed."""
    devices = range(1, servos + 1)
    goals = {device: bytes(GOAL_POSITION.size) for device in devices}
    requests = sync_write_request(GOAL_POSITION.address, GOAL_POSITION.size, goals)
    requests += sync_read_request(BLOCK_ADDRESS, BLOCK_SIZE, list(devices))
    return len(requests) + servos * (STATUS_OVERHEAD + BLOCK_SIZE)


def cycles_per_second(baud: int, servos: int) -> float:
    """Largest rate that the line carries at `baud` bit/s."""
    return 1.0 / (bytes_of_cycle(servos) * byte_time(baud))
