"""`endoscope bench motor_bus`: cycles per second of two servos, beside what the line carries."""

import argparse
import time

from endoscope_devices.dynamixel.bus_thread import BusThread
from endoscope_devices.dynamixel.doctor import bytes_of_cycle, cycles_per_second
from endoscope_devices.dynamixel.settings import BusSettings, ServoMount
from endoscope_emulators.dynamixel.process import EmulatorProcess

BAUDS = (57_600, 1_000_000, 4_000_000)
_STEP_S = 1e-3


def run(args: argparse.Namespace) -> int:
    """Print a line for each speed; return 1 if a cycle failed."""
    print('     baud   bytes  line [1/s]  cycles/s    share  readings/s  failed')
    return 1 if sum(_failed_cycles(baud, args.seconds) for baud in BAUDS) else 0


def _failed_cycles(baud: int, seconds: float) -> int:
    """Run two servos as fast as the bus goes, print, and say how many cycles had no reading."""
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
    limit = cycles_per_second(baud, len(mounts))
    # A servo's clock tells milliseconds apart, no less: the newest readings are fewer than cycles.
    print(
        f'{baud:>9} {bytes_of_cycle(len(mounts)):>7} {limit:>11.1f} {cycles / elapsed:>11.1f} '
        f'{100.0 * cycles / elapsed / limit:>7.1f} % {readings / elapsed:>11.1f} {failures:>7}',
        flush=True,
    )
    return failures
