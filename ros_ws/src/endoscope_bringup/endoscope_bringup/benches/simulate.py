"""`endoscope bench simulate`: how much faster than real time the plant is simulated."""

import argparse

TARGET = 300.0
SECONDS = 10.0
SUBSTEPS_OF_FITS = 3


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `simulate`."""
    parser = subparsers.add_parser(
        'simulate',
        help='how much faster than real time the plant is simulated, bare and with each effect',
        description='Simulates two joints and prints the ratio to real time with nothing on, and '
        'the cost of each effect of the catalogue on both joints. Exits 1 where the bare plant is '
        f'below {TARGET:g} times real time.',
    )
    parser.add_argument(
        '--runs',
        type=int,
        default=7,
        metavar='N',
        help='runs of each, of which the fastest counts (default 7)',
    )


def run(args: argparse.Namespace) -> int:
    """Measure and print; return 0 if the target is reached, else 1."""
    from endoscope_core.effects import CATALOGUE
    from endoscope_core.plant.simulator import SUBSTEPS

    bare = _ratio(None, SUBSTEPS, args.runs)
    fit = _ratio(None, SUBSTEPS_OF_FITS, args.runs)
    print(
        f'two joints, 1 ms ticks: {bare:.0f} x real time at {SUBSTEPS} substeps, '
        f'{fit:.0f} x at {SUBSTEPS_OF_FITS} (target {TARGET:g} x)'
    )
    for effect_id in CATALOGUE:
        ratio = _ratio(effect_id, SUBSTEPS, args.runs)
        print(f'{effect_id:22} {ratio:6.0f} x real time  {bare / ratio:5.2f} x the cost')
    return 0 if bare >= TARGET else 1


def _ratio(effect_id: str | None, substeps: int, runs: int) -> float:
    """Simulated seconds per second of CPU time, the best of some runs."""
    import time

    import numpy as np

    from endoscope_core.plant import EffectSpec, PlantDescription, simulate
    from endoscope_core.plant.simulator import TICK

    ids = () if effect_id is None else (effect_id,)
    plant = PlantDescription(
        effects=tuple(
            EffectSpec(name, joint) for name in ids for joint in PlantDescription().joint_names()
        )
    )
    stamps = np.arange(0.0, SECONDS, TICK)
    command = 0.5 * np.deg2rad(90.0) * np.column_stack([np.sin(stamps), np.cos(2.0 * stamps)])
    simulate(plant, command[:10], substeps=substeps)
    spent = []
    for _ in range(runs):
        # CPU time of this thread: others on the machine shall not count.
        begin = time.thread_time()
        simulate(plant, command, substeps=substeps)
        spent.append(time.thread_time() - begin)
    return SECONDS / min(spent)
