"""`python -m endoscope_explain.generator.draw`: write concealed cases to a folder."""

import argparse
import sys

from endoscope_explain.generator.case_draw import MOTIONS, STRATA, draw_case
from endoscope_explain.generator.case_files import write_case
from endoscope_explain.generator.case_plan import CaseRequest, plan_cases


def main(arguments: list[str] | None = None) -> int:
    """Draw the cases asked for on the command line; returns the exit status."""
    parser = argparse.ArgumentParser(description='Draw concealed cases.')
    parser.add_argument('--out', required=True, metavar='DIR')
    parser.add_argument('--cases', type=int, default=1, metavar='N')
    parser.add_argument('--seed', type=int, default=0, metavar='S')
    parser.add_argument(
        '--stratum', choices=(*STRATA, 'all'), default='all', help='all: in the shares of a bench'
    )
    parser.add_argument('--motion', choices=MOTIONS, default='commissioning')
    parser.add_argument('--effect', action='append', help='conceal this instead of drawing it')
    parser.add_argument('--joint', choices=('bend_x', 'bend_y'))
    asked = parser.parse_args(arguments)
    try:
        for request in _requests(asked):
            case = draw_case(
                request.seed, request.stratum, request.motion, request.effects, asked.joint
            )
            print(write_case(case, asked.out), flush=True)
    except (ValueError, FileExistsError) as error:
        print(f'error: {error}', file=sys.stderr)
        return 2
    return 0


def _requests(asked: argparse.Namespace) -> list[CaseRequest]:
    if asked.stratum == 'all':
        return plan_cases(asked.cases, asked.seed)
    chosen = tuple(asked.effect) if asked.effect else None
    return [
        CaseRequest(seed, asked.stratum, asked.motion, chosen)
        for seed in range(asked.seed, asked.seed + asked.cases)
    ]


if __name__ == '__main__':
    sys.exit(main())
