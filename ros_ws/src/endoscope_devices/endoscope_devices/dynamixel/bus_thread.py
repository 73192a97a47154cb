"""The thread that owns a bus: one sync write and one sync read per cycle, and error handling.

Motion needs the bus to be *armed*, which only :meth:`BusThread.set_torque` does. Any error disarms
it until then: goals are ignored, and the position measured at that moment is held as far as the
servos still obey.
"""

import queue
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from endoscope_devices.device import DeviceError, MotorReading
from endoscope_devices.dynamixel.bring_up import (
    BusSettings,
    ServoMount,
    bring_up,
    enable,
    is_emulated,
)
from endoscope_devices.dynamixel.control_table import (
    ALERT,
    COUNT,
    CURRENT_UNIT,
    GOAL_POSITION,
    HARDWARE_ERROR_STATUS,
    PRESENT_INPUT_VOLTAGE,
    TORQUE_ENABLE,
    WATCHDOG_TRIPPED,
    hardware_errors_in_words,
)
from endoscope_devices.dynamixel.packet_handler import (
    BusError,
    PacketHandler,
    Reply,
    sync_read_request,
    sync_write_request,
)
from endoscope_devices.dynamixel.serial_port import BusPort
from endoscope_devices.dynamixel.servo_block import (
    BLOCK_ADDRESS,
    BLOCK_SIZE,
    BlockJudge,
    Doubt,
    Failure,
    Freshness,
    ServoBlock,
    decode_block,
)

_RETRY_S = 0.5
_HEALTH_PERIOD_S = 0.5
_TROUBLE_SHOWN_S = 1.5
_DRAIN_S = 4e-3
# A shaft that is driven by its wires may be faster than the motor without load.
_SPEED_MARGIN = 1.5
_LARGEST_CURRENT_A = 1193 * CURRENT_UNIT


@dataclass(frozen=True)
class TimedReading:
    """A reading of all shafts."""

    reading: MotorReading
    taken_ns: int  # our monotonic time in ns at which the oldest of it was taken


@dataclass
class ServoHealth:
    """State of a servo other than its motion."""

    model: str = ''
    emulated: bool = False  # whether it says that it is one of this project's emulators
    error: int = 0  # error byte of its last answer
    hardware: str = ''  # errors in words
    voltage: float = 0.0  # V, as last read
    temperature: int = 0  # °C, as last read


@dataclass
class BusFigures:
    """Counters of the thread."""

    cycles: int = 0
    readings: int = 0  # cycles that gave a new reading of all servos
    failures: Counter[str] = field(default_factory=Counter)  # failed cycles by reason
    last_failure: str = ''  # in words
    last_ns: int = 0  # monotonic time in ns of the last valid reading


class BusThread:
    """Runs the bus of the J servos in `mounts`."""

    def __init__(self, settings: BusSettings, mounts: Sequence[ServoMount]) -> None:
        self.settings = settings
        self.mounts = tuple(mounts)
        self.newest: TimedReading | None = None  # the newest valid reading, replaced as a whole
        self.figures = BusFigures()
        self.health = [ServoHealth() for _ in self.mounts]
        self.armed = False  # whether goals are obeyed
        self._ids = [mount.device for mount in self.mounts]
        self._bus: PacketHandler | None = None
        self._judges: list[BlockJudge] = []
        self._unpublished = [False for _ in self.mounts]
        self._patient_from_ns = 0
        self._goal: tuple[tuple[float, ...], int] | None = None
        self._held: tuple[float, ...] | None = None
        self._torque = False
        self._orders: queue.SimpleQueue[bool] = queue.SimpleQueue()
        self._reboot_wanted = threading.Event()
        self._trouble = ''
        self._trouble_ns = 0
        self._next_health_s = 0.0
        self._health_turn = 0
        self._torque_constants: list[float] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f'bus {settings.port}', daemon=True)

    def start(self) -> None:
        """Open the port, set all servos up, and begin; DeviceError if one is not as it must be."""
        try:
            self._connect()
        except OSError as error:
            raise DeviceError(f'{self.settings.port}: the adapter is gone ({error})') from error
        self._thread.start()

    def stop(self) -> None:
        """End the thread; torque goes off if the servos can still be reached."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._disconnect()

    def set_goal(self, goal: Sequence[float]) -> None:
        """Renew the goal: shaft angles (J,) in rad."""
        self._goal = (tuple(goal), time.monotonic_ns())

    def set_torque(self, on: bool) -> None:
        """Order torque on, which arms the bus, or off; carried out in the next cycle."""
        if not on:
            self.armed = False
        self._orders.put(on)

    def reboot(self) -> None:
        """Order a restart of all servos, with torque off, as soon as they can be reached."""
        self.armed = False
        self._reboot_wanted.set()

    def trouble(self) -> str:
        """The error, empty if none; one that has passed is still reported for a while."""
        if self._thread.ident is not None and not self._thread.is_alive():
            return 'the thread of the bus has ended; restart the motor driver'
        recent = time.monotonic_ns() - self._trouble_ns < _TROUBLE_SHOWN_S * 1e9
        return self._trouble if recent else ''

    def age(self) -> float:
        """Seconds since the last valid reading."""
        return (time.monotonic_ns() - self.figures.last_ns) * 1e-9

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                if self._bus is None:
                    self._connect()
                self._serve()
            except OSError as error:
                self._start_over(f'{self.settings.port}: the adapter is gone ({error})')
            except DeviceError as error:
                self._start_over(str(error))

    def _start_over(self, trouble: str) -> None:
        self._fail(trouble)
        self._disconnect()
        self._stopping.wait(_RETRY_S)

    def _connect(self) -> None:
        port = BusPort(self.settings.port, self.settings.baud)
        port.open()
        try:
            bus = PacketHandler(port)
            if self._reboot_wanted.is_set():
                self._restart(bus)
            models = [bring_up(bus, device, self.settings) for device in self._ids]
            emulated = [is_emulated(bus, device) for device in self._ids]
        except (OSError, BusError):
            port.close()
            raise
        bus.return_delay = self.settings.return_delay
        while not self._orders.empty():
            # What was ordered while the bus was away must not happen now.
            self._orders.get()
        self._torque_constants = [model.torque_constant for model in models]
        self._judges = [
            BlockJudge(_SPEED_MARGIN * model.no_load_speed, _LARGEST_CURRENT_A) for model in models
        ]
        self.health = [
            ServoHealth(model.name, known) for model, known in zip(models, emulated, strict=True)
        ]
        self._torque = False
        self._unpublished = [False for _ in self.mounts]
        # The shafts may have been turned since: nothing may be held where they were.
        self.newest = None
        self._bus = bus
        self.figures.last_ns = time.monotonic_ns()

    def _disconnect(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.port.close()

    def _serve(self) -> None:
        bus = self._bus
        if bus is None:
            return
        period = 1.0 / self.settings.rate if self.settings.rate else 0.0
        due = time.monotonic()
        while not self._stopping.is_set():
            self._cycle(bus)
            self._carry_out_orders(bus)
            self._look_after(bus)
            if period:
                due = max(due + period, time.monotonic() - period)
                time.sleep(max(0.0, due - time.monotonic()))
        if self._torque:
            self._switch_off(bus)

    def _carry_out_orders(self, bus: PacketHandler) -> None:
        if self._reboot_wanted.is_set():
            self._restart(bus)
        while not self._orders.empty():
            order = self._orders.get()
            if order and not (self.armed and self._torque):
                held = self._position_now()
                enable(bus, self._counts(held), self.settings)
                self._patient_from_ns = time.monotonic_ns()
                self._held = held
                self._torque = True
                self._goal = None
                self.armed = self._orders.empty()
                self._trouble_ns = 0
            elif not order:
                self._switch_off(bus)

    def _position_now(self) -> tuple[float, ...]:
        if self.newest is None or self.age() > self.settings.fault_after:
            raise BusError('not enabled: there is no valid reading of the shafts')
        return self.newest.reading.position

    def _switch_off(self, bus: PacketHandler) -> None:
        self.armed = False
        for device in self._ids:
            bus.write_register(device, TORQUE_ENABLE, 0)
        self._torque = False

    def _restart(self, bus: PacketHandler) -> None:
        for device in self._ids:
            bus.reboot(device)
        self._reboot_wanted.clear()
        raise BusError('the servos restart as asked')

    def _cycle(self, bus: PacketHandler) -> None:
        request = sync_read_request(BLOCK_ADDRESS, BLOCK_SIZE, self._ids)
        goal = self._goal_now()
        if goal is not None:
            request = self._goal_request(goal) + request
        asked_ns = time.monotonic_ns()
        replies = bus.transact(request, self._ids, BLOCK_SIZE)
        received_ns = time.monotonic_ns()
        self.figures.cycles += 1
        doubt = self._take(replies, asked_ns, received_ns)
        if doubt is None:
            return
        self.figures.failures[doubt.failure] += 1
        self.figures.last_failure = doubt.words
        bus.drain(_DRAIN_S)
        since_ns = max(self.figures.last_ns, self._patient_from_ns)
        silence_s = (time.monotonic_ns() - since_ns) * 1e-9
        if silence_s > self.settings.fault_after:
            self._fail(f'no valid reading for {silence_s * 1e3:.0f} ms: {doubt.words}')
        if doubt.failure is Failure.RESTARTED or silence_s > _RETRY_S:
            raise BusError(f'{doubt.words}; it is set up again')

    def _goal_now(self) -> tuple[float, ...] | None:
        """Goal to send: the newest, or what is held; None while torque is off."""
        if not self._torque:
            return None
        if self.armed and self._goal is not None:
            goal, set_ns = self._goal
            silent_s = (time.monotonic_ns() - set_ns) * 1e-9
            if silent_s <= self.settings.goal_timeout:
                return goal
            self._fail(f'the node has not renewed its goal for {silent_s * 1e3:.0f} ms')
        return self._held

    def _goal_request(self, goal: Sequence[float]) -> bytes:
        data = {
            device: GOAL_POSITION.encode(counts) for device, counts in self._counts(goal).items()
        }
        return sync_write_request(GOAL_POSITION.address, GOAL_POSITION.size, data)

    def _counts(self, shafts: Sequence[float]) -> dict[int, int]:
        return {
            mount.device: round(mount.servo(angle) / COUNT)
            for mount, angle in zip(self.mounts, shafts, strict=True)
        }

    def _take(self, replies: dict[int, Reply], asked_ns: int, received_ns: int) -> Doubt | None:
        """Take the answers of a cycle; why they give no reading, if they do not."""
        blocks: list[ServoBlock] = []
        for k, (mount, judge, health) in enumerate(
            zip(self.mounts, self._judges, self.health, strict=True)
        ):
            reply = replies.get(mount.device)
            if reply is None:
                return Doubt(Failure.NO_ANSWER, f'servo {mount.device} does not answer')
            if len(reply.data) != BLOCK_SIZE:
                return Doubt(Failure.REFUSED, f'servo {mount.device} refuses to be read')
            health.error = reply.error
            block = decode_block(reply.data)
            verdict = judge.judge(block, self.settings.watchdog_counts, asked_ns, received_ns)
            if isinstance(verdict, Doubt):
                return Doubt(verdict.failure, f'servo {mount.device} {verdict.words}')
            # The servos' milliseconds do not begin at the same time.
            self._unpublished[k] |= verdict is Freshness.NEW
            blocks.append(block)
        self.figures.last_ns = received_ns
        if all(self._unpublished):
            self._publish(blocks)
        self._notice(blocks)
        return None

    def _publish(self, blocks: Sequence[ServoBlock]) -> None:
        mounts = self.mounts
        reading = MotorReading(
            tuple(m.shaft(b.position) for m, b in zip(mounts, blocks, strict=True)),
            tuple(m.direction * b.velocity for m, b in zip(mounts, blocks, strict=True)),
            tuple(
                m.direction * b.current * constant
                for m, b, constant in zip(mounts, blocks, self._torque_constants, strict=True)
            ),
        )
        taken = min(
            judge.clock.taken_ns(block.tick)
            for judge, block in zip(self._judges, blocks, strict=True)
        )
        self._unpublished = [False for _ in mounts]
        self.newest = TimedReading(reading, taken)
        self.figures.readings += 1

    def _notice(self, blocks: Sequence[ServoBlock]) -> None:
        for mount, block, health in zip(self.mounts, blocks, self.health, strict=True):
            if block.watchdog == WATCHDOG_TRIPPED and self._torque and self.armed:
                self._fail(
                    f'servo {mount.device} has stopped by itself: its bus watchdog saw no '
                    f'instruction for {self.settings.watchdog * 1e3:.0f} ms'
                )
            if health.error & ALERT and not health.hardware:
                self._disarm()
                self._next_health_s = 0.0
                self._health_turn = self._ids.index(mount.device)
            elif not health.error & ALERT:
                health.hardware = ''
            if health.hardware:
                self._fail(f'servo {mount.device} reports {health.hardware}')

    def _look_after(self, bus: PacketHandler) -> None:
        """Read voltage, temperature and errors of one servo every now and then."""
        now = time.monotonic()
        if now < self._next_health_s:
            return
        self._next_health_s = now + _HEALTH_PERIOD_S
        device, health = self._ids[self._health_turn], self.health[self._health_turn]
        self._health_turn = (self._health_turn + 1) % len(self._ids)
        try:
            slow = bus.read(device, PRESENT_INPUT_VOLTAGE.address, 3).data
            if health.error & ALERT:
                status = bus.read_register(device, HARDWARE_ERROR_STATUS)
                health.hardware = hardware_errors_in_words(status)
        except BusError as error:
            if health.error & ALERT:
                health.hardware = 'a hardware error that it does not name'
            self.figures.failures[Failure.NO_ANSWER] += 1
            self.figures.last_failure = str(error)
            return
        health.voltage = int.from_bytes(slow[:2], 'little') * PRESENT_INPUT_VOLTAGE.scale
        health.temperature = slow[2]

    def _disarm(self) -> None:
        if self.armed:
            self.armed = False
            self._held = None if self.newest is None else self.newest.reading.position

    def _fail(self, trouble: str) -> None:
        self._disarm()
        self._trouble = trouble
        self._trouble_ns = time.monotonic_ns()
