"""Runs an emulated bus as a process: ``python -m endoscope_emulators.dynamixel``.

The first line of its output is the port.  Each line of its input is a JSON list of a method of
:class:`EmulatedBus` or of the faults, and arguments; each is answered with a line of JSON.
"""

import argparse
import json
import os
import sys
from pathlib import Path

from endoscope_devices.dynamixel import control_table as table
from endoscope_devices.dynamixel.control_table import BAUD_CODES, COUNT, Register
from endoscope_emulators.dynamixel.bus import EmulatedBus
from endoscope_emulators.dynamixel.servo import EmulatedServo
from endoscope_emulators.dynamixel.shaft import FirstOrderShaft

_SHOWN = {
    'torque': table.TORQUE_ENABLE,
    'watchdog': table.BUS_WATCHDOG,
    'hardware': table.HARDWARE_ERROR_STATUS,
    'mode': table.OPERATING_MODE,
    'current_limit': table.CURRENT_LIMIT,
}
_ACTIONS = ('plug_in', 'hang_up', 'restart', 'supply', 'overload')
_NICENESS = -10
_FAULTS = ('damage_rate', 'bits', 'delay_s', 'delayed', 'repeated')


def main() -> int:
    """Serve until standard input ends."""
    parser = argparse.ArgumentParser(prog='emulator', description=__doc__)
    parser.add_argument('--ids', type=int, nargs='+', default=[1, 2])
    parser.add_argument('--baud', type=int, default=1_000_000, choices=BAUD_CODES.values())
    parser.add_argument('--link', type=Path, help='path that leads to the terminal')
    parser.add_argument('--stiffness', type=float, default=0.2, help='spring of a shaft, N m/rad')
    args = parser.parse_args()
    code = next(k for k, baud in BAUD_CODES.items() if baud == args.baud)
    servos = [
        EmulatedServo(device, code, shaft=FirstOrderShaft(stiffness=args.stiffness))
        for device in args.ids
    ]
    _go_before_other_processes()
    with EmulatedBus(servos, args.link) as bus:
        print(bus.port, flush=True)
        for line in sys.stdin:
            print(json.dumps(_answer(bus, *json.loads(line))), flush=True)
    return 0


def _go_before_other_processes() -> None:
    """Raise the priority: hardware does not wait for a busy processor; not all users may."""
    try:
        os.nice(_NICENESS)
    except PermissionError:
        return


def _answer(bus: EmulatedBus, action: str, *arguments: float) -> object:
    if action in _ACTIONS:
        return getattr(bus, action)(*arguments)
    with bus.paused() as faults:
        if action == 'silence':
            faults.silent = {int(device) for device in arguments}
        elif action == 'stick':
            bus.servos[int(arguments[0])].stuck = {int(address) for address in arguments[1:]}
        elif action in _FAULTS:
            setattr(faults, action, *arguments)
        elif action == 'trace':
            device, since = arguments
            return [point for point in bus.servos[int(device)].trace if point[0] >= since]
        elif action == 'state':
            return {device: _state(servo) for device, servo in bus.servos.items()}
        else:
            raise ValueError(f"unknown action '{action}'")
    return None


def _state(servo: EmulatedServo) -> dict[str, float]:
    shown: dict[str, Register] = _SHOWN
    values: dict[str, float] = {name: servo.value(register) for name, register in shown.items()}
    values['position'] = servo.shaft.position
    values['goal'] = servo.value(table.GOAL_POSITION) * COUNT
    return values


if __name__ == '__main__':
    sys.exit(main())
