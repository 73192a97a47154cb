"""`endoscope bench paper_tubes`: the demonstration's tubes beside those of the first paper."""

import argparse


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `paper_tubes`."""
    subparsers.add_parser(
        'paper_tubes',
        help="the demonstration's tubes beside those of the first paper's Table 5",
        description='Searches what wires, sheaths and joints can have for the two tubes whose '
        "uncompensated errors and backlash come nearest to the first paper's Table 5, prints their "
        'numbers, and beside the paper what they and the tubes of the demonstration do.',
    )


def run(args: argparse.Namespace) -> int:
    """Search and print; return 0."""
    import numpy as np

    from endoscope_bringup.demo.procedure import TABLE_5, TUBES
    from endoscope_core.trials.paper_tubes import PAPER_MOTIONS, figures, nearest_tubes

    paper = np.array(
        [
            [value.mean for motion in PAPER_MOTIONS for value in TABLE_5[tube.name, motion][0::2]]
            for tube in TUBES
        ]
    )
    found = nearest_tubes(np.deg2rad(paper))
    print(_line('tube', '', [f'{m} {f}' for m in PAPER_MOTIONS for f in ('RMSE', 'backlash')]))
    for tube, joint, printed in zip(TUBES, found, paper, strict=True):
        for name, row in (
            ('paper', printed),
            ('found', np.degrees(figures(joint))),
            ('demonstration', np.degrees(figures(tube.joint))),
        ):
            print(_line(tube.name, name, [f'{value:.2f}' for value in row]))
    for tube, joint in zip(TUBES, found, strict=True):
        print(f'{tube.name}: {joint}')
    return 0


def _line(tube: str, name: str, columns: list[str]) -> str:
    return f'{tube:18} {name:14}' + ''.join(f'{column:>23}' for column in columns)
