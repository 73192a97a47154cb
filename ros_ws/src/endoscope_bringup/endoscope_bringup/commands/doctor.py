"""`endoscope doctor`: finds serial ports and servos, and advises what to change."""

import argparse
from dataclasses import asdict

from endoscope_bringup.subcommands import add_json_option, print_json, within


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `doctor`."""
    parser = subparsers.add_parser(
        'doctor',
        help='find serial ports and servos, and advise what to change',
        description='Looks for Dynamixel servos on serial ports at every speed that they can have '
        '(about a second each), and reports baud, latency timer, firmware, voltage, temperature '
        'and errors. It changes nothing but what --reboot asks for. Exits 1 where there is '
        'something to change. End the motor driver first: a port has one user.',
    )
    parser.add_argument(
        '--port', action='append', help='port to look at; may be repeated (default: all there are)'
    )
    parser.add_argument('--baud', type=int, nargs='+', help='speeds to try (default: all)')
    parser.add_argument(
        '--reboot',
        type=within(0, 252, int),
        metavar='ID',
        help='restart this servo (with one --port and --baud)',
    )
    add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Print what was found on every port; return 1 if anything is to be changed."""
    from endoscope_core.errors import EndoscopeError
    from endoscope_devices.dynamixel.control_table import BAUD_CODES
    from endoscope_devices.dynamixel.doctor import examine, reboot, serial_ports

    bauds = args.baud or list(BAUD_CODES.values())
    wrong = [str(baud) for baud in bauds if baud not in BAUD_CODES.values()]
    if wrong:
        known = ', '.join(map(str, BAUD_CODES.values()))
        raise EndoscopeError(f'servos do not know {", ".join(wrong)} baud: give some of {known}')
    ports = args.port or serial_ports()
    if args.reboot is not None:
        if len(ports) != 1 or len(bauds) != 1:
            raise EndoscopeError('--reboot needs one --port and one --baud')
        reboot(ports[0], bauds[0], args.reboot)
        print(f'{ports[0]}: servo {args.reboot} restarts')
        return 0
    findings = [examine(port, bauds) for port in ports]
    if args.json:
        print_json([asdict(finding) for finding in findings])
    elif not ports:
        print('no serial port: plug the adapter in, or name one with --port')
    else:
        print(*findings, sep='\n')
    return 1 if not ports or any(finding.advice for finding in findings) else 0
