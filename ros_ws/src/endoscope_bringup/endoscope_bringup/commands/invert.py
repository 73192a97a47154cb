"""`endoscope invert`: the command under which a plant moves as desired."""

import argparse
from pathlib import Path


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `invert`."""
    parser = subparsers.add_parser(
        'invert',
        help='plan the command under which a plant moves as desired',
        description='Inverts a plant with all its effects, such as `endoscope explain` exports, '
        'for a motion that is known beforehand. The console plays FILE (source `file`); the '
        "compensator's mode is `none` then.",
    )
    parser.add_argument(
        '--plant', type=Path, required=True, metavar='P.yaml', help='the plant, with its effects'
    )
    parser.add_argument(
        '--motion',
        required=True,
        metavar='NAME',
        help='the motion desired of each joint: periodic, non_periodic, commissioning, calibration',
    )
    parser.add_argument(
        '--out', type=Path, required=True, metavar='FILE', help='command file to write'
    )


def run(args: argparse.Namespace) -> int:
    """Plan and write; return 0."""
    import numpy as np

    from endoscope_core.control.iterated_inverse import iterated_inverse
    from endoscope_core.physics import load_plant
    from endoscope_core.physics.simulator import TICK
    from endoscope_core.signals import motion_by_name
    from endoscope_core.signals.command_file import write_command_file

    plant, motion = load_plant(args.plant), motion_by_name(args.motion)
    joints = plant.joint_names()
    time = np.arange(0.0, motion.duration, TICK)
    chosen = [list(motion.joints).index(joint) for joint in joints]
    angle, velocity = (values[:, chosen] for values in motion.sample(time))
    print(f'inverting {args.plant} for {motion.duration:.0f} s of {motion.name}', flush=True)
    planned = iterated_inverse(plant, angle, velocity)
    write_command_file(args.out, time, planned.command, joints)
    print(
        f'{args.out}: {len(time)} commands; expected error {np.rad2deg(planned.rmse):.2f} deg rms'
    )
    return 0
