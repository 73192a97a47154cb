"""`endoscope bench simulate`: how much faster than real time the plant is simulated."""

import argparse
import time

import numpy as np

from endoscope_core.physics import EffectSpec, PlantDescription, simulate
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.simulator import TICK

TARGET = 1000.0
SECONDS = 10.0
COARSE_TICK = 5e-3


def run(args: argparse.Namespace) -> int:
    """Measure and print; return 0 if the target is reached, else 1."""
    bare = _ratio(None, TICK, args.runs)
    coarse = _ratio(None, COARSE_TICK, args.runs)
    print(
        f'two joints: {bare:.0f} x real time at ticks of 1 ms (target {TARGET:g} x), '
        f'{coarse:.0f} x at {COARSE_TICK * 1e3:g} ms'
    )
    for effect_id in CATALOGUE:
        ratio = _ratio(effect_id, TICK, args.runs)
        print(f'{effect_id:22} {ratio:6.0f} x real time  {bare / ratio:5.2f} x the cost')
    return 0 if bare >= TARGET else 1


def _ratio(effect_id: str | None, tick: float, runs: int) -> float:
    """Simulated seconds per second of CPU time, the best of some runs."""
    ids = () if effect_id is None else (effect_id,)
    plant = PlantDescription(
        effects=tuple(
            EffectSpec(name, joint) for name in ids for joint in PlantDescription().joint_names()
        )
    )
    stamps = np.arange(0.0, SECONDS, tick)
    command = 0.5 * np.deg2rad(90.0) * np.column_stack([np.sin(stamps), np.cos(2.0 * stamps)])
    simulate(plant, command[:10], tick)
    spent = []
    for _ in range(runs):
        # CPU time of this thread: others on the machine shall not count.
        begin = time.thread_time()
        simulate(plant, command, tick)
        spent.append(time.thread_time() - begin)
    return SECONDS / min(spent)
