"""`endoscope prove`: inject effects into rigs, seal the truth, explain, open the seals."""

import argparse
import secrets
from pathlib import Path

from endoscope_bringup.subcommands import COUNT, seed
from endoscope_lab.proof import OWN, SIMULATORS, SLAVE

PAGE = 'index.html'
_SEEDS = 1_000_000


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser(
        'prove',
        help='inject effects into simulated rigs, explain their recordings, and compare',
        description='Draws rigs, injects an effect into most of them, and records each twice. '
        'Writes each truth to a sealed file and prints its SHA-256. Then explains every recording '
        'from itself and the described plant alone, opens the seals, and writes a page that '
        'compares truths and explanations.',
    )
    parser.add_argument(
        '--n', type=COUNT, metavar='N', help='number of rigs (6; of the simulated slave 2)'
    )
    parser.add_argument(
        '--seed', type=seed, help='seed of the rigs (by default a new one every time)'
    )
    parser.add_argument(
        '--effect', metavar='ID', help='effect to inject into all rigs (by default drawn, or none)'
    )
    parser.add_argument(
        '--form',
        choices=SIMULATORS,
        default=OWN,
        help="simulator of the rigs: the product's own, or another one that shares no code with it "
        'and has laws of other forms (own)',
    )
    parser.add_argument(
        '--rig',
        choices=('drawn', SLAVE),
        default='drawn',
        help='what is recorded: drawn rigs, or the simulated slave by the running graph, which '
        'then tracks a motion with the inverse of either plant (drawn)',
    )
    parser.add_argument(
        '--out', type=Path, required=True, metavar='DIR', help='new or empty folder'
    )
    parser.add_argument('--jobs', type=COUNT, default=2, metavar='N', help='rigs in parallel (2)')


def run(args: argparse.Namespace) -> int:
    """Draw, seal, explain, open and write the page; return 0."""
    from datetime import UTC, datetime

    from endoscope_core.atomic_output import make_parent, require_free_directory, write_text
    from endoscope_core.errors import EndoscopeError
    from endoscope_lab.proof import sentences
    from endoscope_lab.proof.comparison_page import page
    from endoscope_lab.proof.drawing import require_drawn
    from endoscope_lab.proof.proving import Proof, prove

    require_free_directory(args.out)
    of_slave = args.rig == SLAVE
    if of_slave and args.form != OWN:
        raise EndoscopeError(f'--rig {SLAVE} and --form {args.form} are mutually exclusive')
    form, count = (SLAVE, args.n or 2) if of_slave else (args.form, args.n or 6)
    if args.effect is not None:
        require_drawn(args.effect, form)
    drawn_by = secrets.randbelow(_SEEDS) if args.seed is None else args.seed
    print(f'seed {drawn_by}: --seed {drawn_by} draws the same rigs again')
    # The folder is visible from the start, so that anyone can compare the digests meanwhile.
    make_parent(args.out)
    args.out.mkdir(exist_ok=True)
    proof = Proof(count, form, drawn_by, args.effect, args.jobs, args.command_line)
    outcomes = prove(proof, args.out, _print_line)
    facts = {
        'date': datetime.now(UTC).date().isoformat(),
        'command': args.command_line,
        'seed': str(drawn_by),
        'simulator': form,
    }
    write_text(args.out / PAGE, page(outcomes, facts))
    _print_line(f'{sentences.headline(outcomes)}.\n{sentences.summary(outcomes)}')
    _print_line(f'Page: {args.out / PAGE}')
    return 0


def _print_line(line: str) -> None:
    print(line, flush=True)
