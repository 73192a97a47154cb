"""One emulated XM430: its control table, what instructions do to it, and how time passes in it.

Sections named here are those of the ROBOTIS e-manual, XM430-W350 and 'DYNAMIXEL Protocol 2.0'.
"""

import math
from collections import deque
from enum import IntEnum

from endoscope_devices.dynamixel import control_table as table
from endoscope_devices.dynamixel.control_table import (
    COUNT,
    CURRENT_UNIT,
    INDIRECT_ADDRESS,
    INDIRECT_DATA,
    TICK_PERIOD,
    VELOCITY_UNIT,
    WATCHDOG_TRIPPED,
    WATCHDOG_UNIT,
    Register,
)
from endoscope_emulators.dynamixel.control_table import (
    BAUD_RATE,
    CONTROL_TABLE,
    GOAL_PWM,
    GOAL_VELOCITY,
    ID,
    INDIRECT_ADDRESS_29,
    INDIRECT_COUNT,
    INDIRECT_DATA_29,
    MAX_POSITION_LIMIT,
    MIN_POSITION_LIMIT,
    MIN_VOLTAGE_LIMIT,
    MOVING,
    PRESENT_POSITION,
    PRESENT_VELOCITY,
    TABLE_SIZE,
)
from endoscope_emulators.dynamixel.shaft import FirstOrderShaft

STEP_S = 1e-3
REBOOT_S = 0.2
OVERLOAD_S = 1.0
_OVERLOAD_BIT = 0x20
_VOLTAGE_BIT = 0x01
_POSITION_MODE = 3
_TRACE_LENGTH = 60_000

_GOALS = {
    GOAL_PWM,
    table.GOAL_CURRENT,
    GOAL_VELOCITY,
    table.PROFILE_ACCELERATION,
    table.PROFILE_VELOCITY,
    table.GOAL_POSITION,
}
_BY_ADDRESS = {register.address: register for register in CONTROL_TABLE}
_DEFINED = {
    *(r.address + k for r in CONTROL_TABLE for k in range(r.size)),
    *range(INDIRECT_ADDRESS, INDIRECT_ADDRESS + 2 * INDIRECT_COUNT),
    *range(INDIRECT_DATA, INDIRECT_DATA + INDIRECT_COUNT),
    *range(INDIRECT_ADDRESS_29, INDIRECT_ADDRESS_29 + 2 * INDIRECT_COUNT),
    *range(INDIRECT_DATA_29, INDIRECT_DATA_29 + INDIRECT_COUNT),
}


class ErrorNumber(IntEnum):
    """Error numbers of a status packet ('Protocol 2.0', 'Error')."""

    NONE = 0
    RESULT_FAIL = 1
    INSTRUCTION = 2
    CRC = 3
    DATA_RANGE = 4
    DATA_LENGTH = 5
    DATA_LIMIT = 6
    ACCESS = 7


class EmulatedServo:
    """A servo that is advanced by the time of its bus; `baud_code` as in Baud Rate(8).

    Its Model Information(2) says that it is emulated.
    """

    def __init__(
        self,
        device: int,
        baud_code: int = 3,
        model: int = 1020,
        information: int = table.EMULATED,
        shaft: FirstOrderShaft | None = None,
    ) -> None:
        self.shaft = FirstOrderShaft() if shaft is None else shaft
        # Time in s and shaft angle in rad, each ms.
        self.trace: deque[tuple[float, float]] = deque(maxlen=_TRACE_LENGTH)
        self.supply = 12.0  # V
        # Addresses of registers that acknowledge a write and do not keep it, as worn cells do.
        self.stuck: set[int] = set()
        self._memory = bytearray(TABLE_SIZE)
        for register in CONTROL_TABLE:
            if register.eeprom:
                self._store(register, register.initial)
        self._store(table.MODEL_NUMBER, model)
        self._store(table.MODEL_INFORMATION, information)
        self._store(ID, device)
        self._store(BAUD_RATE, baud_code)
        self._now = self._begin = 0.0
        self._steps = 0
        self._born = 0.0
        self._silent_until = 0.0
        self._heard = 0.0
        self._saturated_s = 0.0
        self._started = False
        self._power_up()

    def value(self, register: Register) -> int:
        """Counts in a register."""
        end = register.address + register.size
        return register.decode(bytes(self._memory[register.address : end]))

    def answers(self, now: float) -> bool:
        """Whether it is powered and not restarting at time ``now`` in s."""
        return self.supply > 0.0 and now >= self._silent_until

    def advance(self, now: float) -> None:
        """Let time pass in it, to `now` in s of the bus."""
        if not self._started:
            self._started = True
            self._begin = self._now = self._born = self._heard = now
        due = math.floor((now - self._begin) / STEP_S + 1e-6)
        while self._steps < due:
            self._steps += 1
            self._now = self._begin + self._steps * STEP_S
            self._step()

    def hear(self, now: float) -> None:
        """Note an instruction packet, which feeds the bus watchdog, at time ``now`` in s."""
        self._heard = now

    def restart(self, now: float) -> None:
        """Lose all of RAM and be away for a moment ('Reboot'), from time ``now`` in s."""
        self._silent_until = now + REBOOT_S
        self._born = now + REBOOT_S
        self._power_up()

    def overload(self) -> None:
        """Detect an overload now ('Hardware Error Status(70)')."""
        self._detect(_OVERLOAD_BIT)

    def alert(self) -> int:
        """Alert bit of the error byte: set while Hardware Error Status(70) is not zero."""
        return table.ALERT if self.value(table.HARDWARE_ERROR_STATUS) else 0

    def read(self, address: int, size: int) -> tuple[ErrorNumber, bytes]:
        """Answer to a read of ``size`` bytes from ``address``; undefined ones are not read."""
        span = range(address, address + size)
        if not size or address + size > TABLE_SIZE or not any(a in _DEFINED for a in span):
            return ErrorNumber.ACCESS, b''
        return ErrorNumber.NONE, bytes(self._memory[self._resolve(a)] for a in span)

    def write(self, address: int, data: bytes) -> ErrorNumber:
        """Do what a write of ``data`` to ``address`` does; nothing where any of it is refused."""
        if address in _INDIRECT_ADDRESSES:
            return self._write_map(address, data)
        targets = [self._resolve(address + k) for k in range(len(data))]
        changes: list[tuple[Register, int]] = []
        k = 0
        while k < len(data):
            register = _BY_ADDRESS.get(targets[k]) if targets[k] < TABLE_SIZE else None
            if register is None:
                if targets[k] not in _INDIRECT_DATA_BYTES:
                    return ErrorNumber.ACCESS
                self._memory[targets[k]] = data[k]
                k += 1
                continue
            part = data[k : k + register.size]
            if len(part) < register.size:
                return ErrorNumber.DATA_LENGTH
            error = self._refusal(register, register.decode(part))
            if error:
                return error
            changes.append((register, register.decode(part)))
            k += register.size
        for register, counts in changes:
            if register.address not in self.stuck:
                self._apply(register, counts)
        return ErrorNumber.NONE

    def _write_map(self, address: int, data: bytes) -> ErrorNumber:
        if len(data) % 2 or address % 2:
            return ErrorNumber.DATA_LENGTH
        if address + len(data) - 2 not in _INDIRECT_ADDRESSES:
            return ErrorNumber.ACCESS
        for k in range(0, len(data), 2):
            if int.from_bytes(data[k : k + 2], 'little') not in _DEFINED:
                return ErrorNumber.DATA_RANGE
        self._memory[address : address + len(data)] = data
        return ErrorNumber.NONE

    def _refusal(self, register: Register, counts: int) -> ErrorNumber:
        """Why a register cannot be set ('Error': range, limit, access)."""
        torque = self.value(table.TORQUE_ENABLE)
        if not register.writable or (register.eeprom and torque):
            return ErrorNumber.ACCESS
        low, high = register.low, register.high
        if (low is not None and counts < low) or (high is not None and counts > high):
            return ErrorNumber.DATA_RANGE
        if register in _GOALS and self.value(table.BUS_WATCHDOG) == WATCHDOG_TRIPPED:
            return ErrorNumber.DATA_RANGE
        if register is table.GOAL_CURRENT and abs(counts) > self.value(table.CURRENT_LIMIT):
            return ErrorNumber.DATA_LIMIT
        if (
            register is table.GOAL_POSITION
            and self.value(table.OPERATING_MODE) == _POSITION_MODE
            and not self.value(MIN_POSITION_LIMIT) <= counts <= self.value(MAX_POSITION_LIMIT)
        ):
            return ErrorNumber.DATA_LIMIT
        if register is table.TORQUE_ENABLE and counts and self._shut_down():
            return ErrorNumber.RESULT_FAIL
        return ErrorNumber.NONE

    def _apply(self, register: Register, counts: int) -> None:
        self._store(register, counts)
        if register is table.OPERATING_MODE:
            self._reset_goals()
        if register is table.TORQUE_ENABLE and counts:
            self._saturated_s = 0.0

    def _shut_down(self) -> bool:
        return bool(self.value(table.HARDWARE_ERROR_STATUS) & self.value(table.SHUTDOWN))

    def _detect(self, bit: int) -> None:
        status = self.value(table.HARDWARE_ERROR_STATUS) | bit
        self._store(table.HARDWARE_ERROR_STATUS, status)
        if self._shut_down():
            self._store(table.TORQUE_ENABLE, 0)

    def _power_up(self) -> None:
        for register in CONTROL_TABLE:
            if not register.eeprom:
                self._store(register, register.initial)
        for first, data in (
            (INDIRECT_ADDRESS, INDIRECT_DATA),
            (INDIRECT_ADDRESS_29, INDIRECT_DATA_29),
        ):
            for k in range(INDIRECT_COUNT):
                at = first + 2 * k
                self._memory[at : at + 2] = (data + k).to_bytes(2, 'little')
                self._memory[data + k] = 0
        self._store(table.GOAL_CURRENT, self.value(table.CURRENT_LIMIT))
        self._saturated_s = 0.0
        self._show()
        self._reset_goals()

    def _reset_goals(self) -> None:
        self._store(table.GOAL_POSITION, self.value(PRESENT_POSITION))
        self._store(table.GOAL_CURRENT, self.value(table.CURRENT_LIMIT))

    def _step(self) -> None:
        if self.answers(self._now):
            self._work()
        else:
            self.shaft.velocity = 0.0
        self.trace.append((self._now, self.shaft.position))

    def _work(self) -> None:
        torque = bool(self.value(table.TORQUE_ENABLE))
        self._watch_bus(torque)
        limit = self.value(table.CURRENT_LIMIT)
        if self.value(table.OPERATING_MODE) == table.CURRENT_BASED_POSITION:
            limit = min(limit, abs(self.value(table.GOAL_CURRENT)))
        goal = self.value(table.GOAL_POSITION) * COUNT if torque else None
        current = self.shaft.advance(goal, limit * CURRENT_UNIT, STEP_S)
        self._store(table.PRESENT_CURRENT, round(current / CURRENT_UNIT))
        self._show()
        self._watch_load(torque, abs(current) >= 0.999 * limit * CURRENT_UNIT > 0.0)
        if self.supply < self.value(MIN_VOLTAGE_LIMIT) * 0.1:
            self._detect(_VOLTAGE_BIT)

    def _watch_bus(self, torque: bool) -> None:
        """Bus Watchdog(98): with torque on, a silence stops the shaft and goals are read-only."""
        watchdog = self.value(table.BUS_WATCHDOG)
        if torque and watchdog > 0 and self._now - self._heard > watchdog * WATCHDOG_UNIT:
            self._store(table.BUS_WATCHDOG, WATCHDOG_TRIPPED)
            self._store(table.GOAL_POSITION, self.value(PRESENT_POSITION))

    def _watch_load(self, torque: bool, saturated: bool) -> None:
        self._saturated_s = self._saturated_s + STEP_S if torque and saturated else 0.0
        if self._saturated_s > OVERLOAD_S:
            self._detect(_OVERLOAD_BIT)

    def _show(self) -> None:
        self._store(PRESENT_POSITION, round(self.shaft.position / COUNT))
        self._store(PRESENT_VELOCITY, round(self.shaft.velocity / VELOCITY_UNIT))
        self._store(table.PRESENT_INPUT_VOLTAGE, round(self.supply * 10.0))
        tick = math.floor((self._now - self._born) * 1e3 + 1e-6)
        self._store(table.REALTIME_TICK, max(0, tick) % TICK_PERIOD)
        self._store(MOVING, int(abs(self.shaft.velocity) > 10 * VELOCITY_UNIT))

    def _store(self, register: Register, counts: int) -> None:
        end = register.address + register.size
        self._memory[register.address : end] = register.encode(counts)

    def _resolve(self, address: int) -> int:
        """Address behind an indirect datum, or the address itself ('Indirect Address, Data')."""
        for first, data in (
            (INDIRECT_ADDRESS, INDIRECT_DATA),
            (INDIRECT_ADDRESS_29, INDIRECT_DATA_29),
        ):
            if data <= address < data + INDIRECT_COUNT:
                at = first + 2 * (address - data)
                return int.from_bytes(self._memory[at : at + 2], 'little')
        return address


_INDIRECT_ADDRESSES = {
    first + 2 * k
    for first in (INDIRECT_ADDRESS, INDIRECT_ADDRESS_29)
    for k in range(INDIRECT_COUNT)
}
_INDIRECT_DATA_BYTES = {
    first + k for first in (INDIRECT_DATA, INDIRECT_DATA_29) for k in range(INDIRECT_COUNT)
}
