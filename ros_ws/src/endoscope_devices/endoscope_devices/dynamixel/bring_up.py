"""How a bus and its servos are set up, each refused unless everything reads back as written."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from endoscope_devices.device import DeviceError
from endoscope_devices.dynamixel.control_table import (
    BUS_WATCHDOG,
    COUNT,
    CURRENT_BASED_POSITION,
    CURRENT_LIMIT,
    CURRENT_UNIT,
    DRIVE_MODE,
    EMULATED,
    FIRMWARE_VERSION,
    GOAL_CURRENT,
    GOAL_POSITION,
    HARDWARE_ERROR_STATUS,
    MODEL_INFORMATION,
    MODEL_NUMBER,
    MODELS,
    OPERATING_MODE,
    PROFILE_ACCELERATION,
    PROFILE_VELOCITY,
    RETURN_DELAY_TIME,
    RETURN_DELAY_UNIT,
    SHUTDOWN,
    STATUS_RETURN_LEVEL,
    TORQUE_ENABLE,
    WATCHDOG_UNIT,
    Register,
    ServoModel,
    hardware_errors_in_words,
)
from endoscope_devices.dynamixel.packet_handler import QUIET_S, BusError, PacketHandler
from endoscope_devices.dynamixel.servo_block import JITTER, MAP_ADDRESS, MAP_BYTES

# Overload, electrical shock and overheating let the shaft go, as the maker sets it.
_SHUTDOWN = 0b110100
_EVERY_STATUS = 2


@dataclass(frozen=True)
class ServoMount:
    """How a servo is built in."""

    name: str  # of its motor
    device: int  # its id on the bus
    direction: int = 1  # 1, or -1 where the shaft's positive sense is the servo's negative one
    zero: float = math.pi  # servo angle in rad at which the shaft is at 0

    def shaft(self, servo: float) -> float:
        """Shaft angle of a servo angle, in rad."""
        return self.direction * (servo - self.zero)

    def servo(self, shaft: float) -> float:
        """Servo angle of a shaft angle, in rad."""
        return self.zero + self.direction * shaft


@dataclass(frozen=True)
class BusSettings:
    """Settings of the bus."""

    port: str  # device file
    baud: int = 1_000_000  # bit/s
    current_limit: float = 0.5  # A at which the servos' firmware limits the tension of the wires
    # Silence in s after which a servo stops by itself; a multiple of 20 ms is taken.
    watchdog: float = 0.1
    return_delay: float = 0.0  # s that a servo waits before it answers
    rate: float = 1000.0  # cycles per second at most; 0 for as many as the bus carries
    # Time in s after which a goal that nobody renewed is given up and the measured position held.
    goal_timeout: float = 0.1
    # Silence of a servo in s after which motion is refused until it is enabled again.
    fault_after: float = 0.05

    def __post_init__(self) -> None:
        for register, counts in (
            (BUS_WATCHDOG, self.watchdog_counts),
            (CURRENT_LIMIT, self.current_counts),
        ):
            largest = register.high or 0
            if not 1 <= counts <= largest:
                unit, scale = register.unit, register.scale
                raise DeviceError(
                    f'{register.name} of {counts * scale:g} {unit} is not possible; give '
                    f'{scale:g} to {largest * scale:g} {unit}'
                )

    @property
    def watchdog_counts(self) -> int:
        """Value of Bus Watchdog(98)."""
        return math.ceil(self.watchdog / WATCHDOG_UNIT - 1e-9)

    @property
    def current_counts(self) -> int:
        """Value of Current Limit(38), never more than was asked for."""
        return int(self.current_limit / CURRENT_UNIT + 1e-9)

    @property
    def return_delay_counts(self) -> int:
        """Value of Return Delay Time(9)."""
        return round(self.return_delay / RETURN_DELAY_UNIT)


def wanted_registers(settings: BusSettings) -> dict[Register, int]:
    """What every servo's registers shall hold before it may be enabled, in counts."""
    return {
        RETURN_DELAY_TIME: settings.return_delay_counts,
        DRIVE_MODE: 0,
        OPERATING_MODE: CURRENT_BASED_POSITION,
        CURRENT_LIMIT: settings.current_counts,
        SHUTDOWN: _SHUTDOWN,
        STATUS_RETURN_LEVEL: _EVERY_STATUS,
        BUS_WATCHDOG: settings.watchdog_counts,
        GOAL_CURRENT: settings.current_counts,
        PROFILE_ACCELERATION: 0,
        PROFILE_VELOCITY: 0,
    }


def bring_up(bus: PacketHandler, device: int, settings: BusSettings) -> ServoModel:
    """Set one servo up with its torque off, and return its model; BusError if it does not take it.

    Registers of the EEPROM, which wears, are written only where they differ.
    """
    number, _ = bus.ping(device)
    if number not in MODELS:
        known = ', '.join(model.name for model in MODELS.values())
        raise BusError(f'servo {device} has model number {number}; this driver is for {known}')
    _refuse_hardware_errors(bus, device)
    bus.write_register(device, TORQUE_ENABLE, 0)
    bus.write_register(device, BUS_WATCHDOG, 0)
    for register, counts in wanted_registers(settings).items():
        if not register.eeprom or bus.read_register(device, register) != counts:
            bus.write_register(device, register, counts)
    bus.write(device, MAP_ADDRESS, MAP_BYTES)
    bus.drain(QUIET_S)
    verify(bus, device, settings)
    return MODELS[number]


def is_emulated(bus: PacketHandler, device: int) -> bool:
    """Return whether a servo is one of this project's emulators; BusError if it does not answer."""
    # Of a length that nothing else has, as in `verify`.
    area = (MODEL_NUMBER, MODEL_INFORMATION, FIRMWARE_VERSION)
    return _read_area(bus, device, area)[MODEL_INFORMATION] == EMULATED


def verify(
    bus: PacketHandler, device: int, settings: BusSettings, but: Register | None = None
) -> None:
    """Read back what :func:`bring_up` wrote, except the register `but`; BusError where any differs.

    Whole areas are read, each of a length that nothing else has, so that no answer to an earlier
    question can be taken for them.
    """
    wanted = wanted_registers(settings)
    for area in ([r for r in wanted if r.eeprom], [r for r in wanted if not r.eeprom]):
        found = _read_area(bus, device, area)
        for register in area:
            if found[register] != wanted[register] and register is not but:
                raise BusError(
                    f'servo {device} is not enabled: {register.name}({register.address}) reads '
                    f'{found[register]} instead of {wanted[register]}'
                )
    if bus.read(device, MAP_ADDRESS, len(MAP_BYTES)).data != MAP_BYTES:
        raise BusError(f'servo {device} is not enabled: it does not keep its indirect addresses')
    _refuse_hardware_errors(bus, device)


def _read_area(
    bus: PacketHandler, device: int, registers: Sequence[Register]
) -> dict[Register, int]:
    first = min(register.address for register in registers)
    size = max(register.address + register.size for register in registers) - first
    data = bus.read(device, first, size).data
    return {
        register: register.decode(
            data[register.address - first : register.address - first + register.size]
        )
        for register in registers
    }


def _refuse_hardware_errors(bus: PacketHandler, device: int) -> None:
    status = bus.read_register(device, HARDWARE_ERROR_STATUS)
    if status:
        raise BusError(
            f'servo {device} reports {hardware_errors_in_words(status)}; once its cause is gone, '
            'restart it (power, service motor/reboot, or `endoscope doctor --reboot`)'
        )


def enable(bus: PacketHandler, goals: Mapping[int, int], settings: BusSettings) -> None:
    """Let servos hold the positions `goals`, in counts by id, where they are.

    These must have passed every check of a reading, which the answer to a single question has not.
    BusError where anything is not as it was set; no torque is switched on then.
    """
    for device, goal in goals.items():
        # Only 0 ends the error state of a watchdog that has tripped, and until then goals are
        # read-only.
        bus.write_register(device, BUS_WATCHDOG, 0)
        bus.write_register(device, GOAL_POSITION, goal)
        verify(bus, device, settings, but=BUS_WATCHDOG)
        kept = bus.read_register(device, GOAL_POSITION)
        # The shaft may yield meanwhile, and firmware that follows it is no fault.
        if abs(kept - goal) * COUNT > JITTER:
            raise BusError(
                f'servo {device} is not enabled: Goal Position(116) reads {kept} instead of {goal}'
            )
    for device in goals:
        bus.write_register(device, BUS_WATCHDOG, settings.watchdog_counts)
        bus.write_register(device, TORQUE_ENABLE, 1)
        found = _read_area(bus, device, (TORQUE_ENABLE, BUS_WATCHDOG))
        if found != {TORQUE_ENABLE: 1, BUS_WATCHDOG: settings.watchdog_counts}:
            raise BusError(
                f'servo {device} does not switch its torque on: Torque Enable(64) reads '
                f'{found[TORQUE_ENABLE]}, Bus Watchdog(98) {found[BUS_WATCHDOG]}'
            )
