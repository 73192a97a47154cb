"""`endoscope bench motor_bus`: cycles per second of two servos, beside what the line carries."""

import argparse
import time
from dataclasses import dataclass

from endoscope_devices.dynamixel.bus_thread import BusThread
from endoscope_devices.dynamixel.doctor import bytes_of_cycle, cycles_per_second
from endoscope_devices.dynamixel.settings import BusSettings, ServoMount
from endoscope_emulators.dynamixel.process import EmulatorProcess

BAUDS = (57_600, 1_000_000, 4_000_000)
_STEP_S = 1e-3


@dataclass(frozen=True)
class MotorBusFigure:
    """What one run measured."""

    baud: int  # bits per second
    cycle_bytes: int  # bytes of a cycle
    limit: float  # cycles per second that the line carries
    rate: float  # cycles per second that were run
    readings: float  # new ones per second; a servo's clock tells milliseconds apart, no less
    failed: int  # cycles without a valid reading

    def __str__(self) -> str:
        return (
            f'{self.baud:>9} {self.cycle_bytes:>7} {self.limit:>11.1f} {self.rate:>11.1f} '
            f'{100.0 * self.rate / self.limit:>7.1f} % {self.readings:>11.1f} {self.failed:>7}'
        )


def run(args: argparse.Namespace) -> int:
    """Print a line for each speed; return 1 if a cycle failed."""
    print('     baud   bytes  line [1/s]  cycles/s    share  readings/s  failed')
    failed = 0
    for baud in BAUDS:
        figure = run_motor_bus_bench(baud, args.seconds)
        print(figure, flush=True)
        failed += figure.failed
    return 1 if failed else 0


def run_motor_bus_bench(baud: int, seconds: float) -> MotorBusFigure:
    """Run two servos as fast as the bus goes."""
    mounts = [ServoMount('motor_x', 1), ServoMount('motor_y', 2)]
    with EmulatorProcess(baud=baud) as emulator:
        bus = BusThread(BusSettings(emulator.port, baud, rate=0.0), mounts)
        bus.start()
        try:
            bus.set_torque(True)
            until = time.monotonic() + 5.0
            while not bus.armed:
                if time.monotonic() > until:
                    raise RuntimeError(f'the servos are not enabled: {bus.trouble()}')
                time.sleep(_STEP_S)
            before, began = (bus.figures.cycles, bus.figures.readings), time.monotonic()
            failures = sum(bus.figures.failures.values())
            while (elapsed := time.monotonic() - began) < seconds:
                bus.set_goal((0.0, 0.0))
                time.sleep(_STEP_S)
            cycles = bus.figures.cycles - before[0]
            readings = bus.figures.readings - before[1]
            failures = sum(bus.figures.failures.values()) - failures
        finally:
            bus.stop()
    return MotorBusFigure(
        baud,
        bytes_of_cycle(len(mounts)),
        cycles_per_second(baud, len(mounts)),
        cycles / elapsed,
        readings / elapsed,
        failures,
    )
