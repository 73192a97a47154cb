"""`endoscope identify`: hysteresis parameters from a bag."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_bringup.subcommands import seed, within
from endoscope_core.choices import HYSTERESIS_MODELS, PHYSICAL
from endoscope_core.errors import FileError

if TYPE_CHECKING:
    from endoscope_bags import Recording
    from endoscope_core.hysteresis import HysteresisParameters
    from endoscope_core.identification import HysteresisRecording, UpdatedTable

MODELS = (*HYSTERESIS_MODELS, PHYSICAL)


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `identify`."""
    parser = subparsers.add_parser(
        'identify',
        help='fit a hysteresis model to a recording',
        description='Fits a hysteresis model to each joint of a bag, and the feed-forward that '
        'goes with it. Prints JSON, or writes it to FILE.',
    )
    parser.add_argument('source', type=Path, metavar='BAG', help='rosbag2 folder or .mcap')
    parser.add_argument('--model', choices=MODELS, required=True, help='the model')
    parser.add_argument(
        '--table',
        type=Path,
        metavar='FILE',
        help='updated table to which the calibration in BAG is added; made if it is not there',
    )
    parser.add_argument('--out', type=Path, metavar='FILE', help='JSON file to write')
    parser.add_argument('--seed', type=seed, default=0, help='of the search (0)')
    parser.add_argument(
        '--gear',
        type=within(1e-3, 1e3, float),
        help='motor shaft angle for one radian at the joint (that of the rig in BAG)',
    )


def run(args: argparse.Namespace) -> int:
    """Identify and write; return 0."""
    import json

    from endoscope_core.atomic_output import require_place, write_text
    from endoscope_core.errors import EndoscopeError

    for file in (args.out, args.table):
        if file is not None:
            require_place(file)
    if args.table is not None and args.model == PHYSICAL:
        raise EndoscopeError('--table takes the name of a hysteresis model')
    if args.table is not None:
        _table(args)
    content = _of_bag(args)
    text = json.dumps(content, indent=1) + '\n'
    if args.out is None:
        sys.stdout.write(text)
    else:
        write_text(args.out, text)
        print(f'{args.out}: written', file=sys.stderr)
    return 0


def _of_bag(args: argparse.Namespace) -> dict[str, object]:
    from endoscope_bringup.joints_of_bag import hysteresis_of_bag
    from endoscope_core.control import FeedforwardSettings
    from endoscope_core.identification import Servo, fit_feedforward, fit_model

    if args.model == PHYSICAL:
        return _plant_of_bag(args)
    lead = FeedforwardSettings.lead
    joints: dict[str, object] = {}
    for joint, recording in hysteresis_of_bag(*_bag_and_gear(args)).items():
        model = fit_model([recording], args.seed, args.model)
        feedforward = fit_feedforward(model.parameters, Servo(), lead, args.seed)
        _report(f'{joint}: {model}')
        joints[joint] = {
            'feedforward': feedforward.parameters.to_dict(),
            'model': model.parameters.to_dict(),
            'model_rmse': model.rmse,
        }
        if args.table is not None:
            _extend(args, recording, feedforward.parameters, f'{args.source.name} {joint}')
    return {'schema': 1, 'model': args.model, 'lead': lead, 'seed': args.seed, 'joints': joints}


def _bag_and_gear(args: argparse.Namespace) -> tuple['Recording', float]:
    from endoscope_bags import open_bag
    from endoscope_bags.recording import rig_of_bag

    bag = open_bag(args.source)
    return bag, rig_of_bag(bag).joints.gear if args.gear is None else args.gear


def _plant_of_bag(args: argparse.Namespace) -> dict[str, object]:
    from endoscope_bringup.joints_of_bag import plant_recordings_of_bag
    from endoscope_core.identification import fit_plant

    joints: dict[str, object] = {}
    bag, gear = _bag_and_gear(args)
    for joint, recording in plant_recordings_of_bag(bag, gear).items():
        fit = fit_plant(recording.command, recording.tension, recording.bending, gear=gear)
        _report(
            f'{joint}: capstan exponent {fit.parameters.joint.capstan_exponent:.3f}, '
            f'{fit.tension_rmse:.3f} N rms'
        )
        joints[joint] = {
            'model': fit.parameters.to_dict(),
            'tension_rmse': fit.tension_rmse,
            'bending_rmse': fit.bending_rmse,
        }
    return {'schema': 1, 'model': 'physical', 'joints': joints}


def _table(args: argparse.Namespace) -> 'UpdatedTable | None':
    """Return the table so far; FileError for one of another model."""
    from endoscope_core.identification import UpdatedTable

    if not args.table.is_file():
        return None
    table = UpdatedTable.load(args.table)
    if table.model != args.model:
        raise FileError(f'{args.table} is a table of {table.model}, not {args.model}')
    return table


def _extend(
    args: argparse.Namespace,
    recording: 'HysteresisRecording',
    parameters: 'HysteresisParameters',
    source: str,
) -> None:
    """Add one joint's calibration to the table, under the backlash size that it shows."""
    import math

    import numpy as np

    from endoscope_bringup.joints_of_bag import GRID_STEP
    from endoscope_core.identification import Servo, TableEntry, UpdatedTable
    from endoscope_core.metrics import width_at_mid_height

    # The motor follows its command late; the backlash size is that over the command.
    commanded = recording.driver + Servo().lag * np.gradient(recording.driver, GRID_STEP)
    size = width_at_mid_height(commanded, recording.actual)
    entry = TableEntry(size, parameters, source)
    table = _table(args)
    table = table.extended(entry) if table else UpdatedTable.of(args.model, [entry])
    table.save(args.table)
    _report(f'{args.table}: {len(table.entries)} entries, {math.degrees(size):.1f} deg added')


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
