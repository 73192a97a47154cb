"""`endoscope invert`: the command under which a plant moves as desired."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_APPROACH_S = 2.0


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `invert`."""
    parser = subparsers.add_parser(
        'invert',
        help='plan the command under which a plant moves as desired',
        description='Inverts a plant with all its effects, such as `endoscope explain` exports, '
        'for a motion that is known beforehand. The master plays FILE (source `file`); the '
        "compensator's mode is `none` then.",
    )
    parser.add_argument(
        '--plant', type=Path, required=True, metavar='P.yaml', help='the plant, with its effects'
    )
    parser.add_argument(
        '--motion',
        required=True,
        metavar='NAME|FILE|BAG',
        help='the motion desired of each joint: periodic, non_periodic, commissioning or '
        'calibration; a CSV file as the master plays it: time in s, bend_x and bend_y in rad; '
        'or the desired angles of a bag, slave/servo_jp',
    )
    parser.add_argument(
        '--out', type=Path, required=True, metavar='FILE', help='command file to write'
    )


def run(args: argparse.Namespace) -> int:
    """Plan and write; return 0."""
    import numpy as np

    from endoscope_core.atomic_output import require_place
    from endoscope_core.control.iterated_inverse import iterated_inverse
    from endoscope_core.physics import load_plant
    from endoscope_core.physics.simulator import TICK
    from endoscope_core.signals.command_file import write_command_file

    require_place(args.out)
    plant = load_plant(args.plant)
    joints = plant.joint_names()
    angle, velocity = _from_straight(*_desired(args.motion, joints, TICK), TICK)
    time = np.arange(len(angle)) * TICK
    print(f'inverting {args.plant} for {time[-1] + TICK:.0f} s of {args.motion}', flush=True)
    planned = iterated_inverse(plant, angle, velocity)
    write_command_file(args.out, time, planned.command, joints)
    print(
        f'{args.out}: {len(time)} commands; expected error {np.rad2deg(planned.rmse):.2f} deg rms'
    )
    return 0


def _desired(motion: str, joints: Sequence[str], tick: float) -> 'tuple[Array, Array]':
    """Angles and velocities at every tick, in rad and rad/s, shape (N, J)."""
    import numpy as np

    from endoscope_bags import open_bag
    from endoscope_core.errors import FileError, nearest
    from endoscope_core.signals.command_file import CommandTable, read_command_file
    from endoscope_core.signals.motions import MOTIONS, motion_by_name

    path = Path(motion)
    if motion not in MOTIONS and not path.exists():
        raise FileError(f'no motion and no file {motion!r}: {nearest(motion, MOTIONS)}')
    if motion in MOTIONS:
        named = motion_by_name(motion)
        time = np.arange(0.0, named.duration, tick)
        chosen = [list(named.joints).index(joint) for joint in joints]
        angle, velocity = (values[:, chosen] for values in named.sample(time))
        return angle, velocity
    if path.is_file() and path.suffix not in ('.mcap', '.db3'):
        return read_command_file(path, joints).sampled(tick)
    series = open_bag(path).joint_state('slave/servo_jp', finite=('position',))
    missing = set(joints) - set(series.names)
    if series.position is None or missing:
        raise FileError(f'{path}: {series.topic} has no angle of {", ".join(sorted(missing))}')
    seconds = series.seconds(int(series.stamp_ns[0]))
    new = np.r_[True, np.diff(seconds) > 0.0]
    columns = [series.names.index(joint) for joint in joints]
    table = CommandTable(tuple(joints), seconds[new], series.position[np.ix_(new, columns)])
    return table.sampled(tick)


def _from_straight(angle: 'Array', velocity: 'Array', tick: float) -> 'tuple[Array, Array]':
    """Begin with the way from straight and at rest, where a plant begins, to the first angle."""
    import numpy as np

    from endoscope_core.signals import move

    if not angle[0].any():
        return angle, velocity
    time = np.arange(0.0, _APPROACH_S, tick)
    legs = [move(0.0, end, _APPROACH_S)(time) for end in angle[0].tolist()]
    way = [np.stack([leg[k] for leg in legs], axis=1) for k in (0, 1)]
    return np.concatenate([way[0], angle]), np.concatenate([way[1], velocity])
