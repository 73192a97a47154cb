"""How rare misfits of free motion are over rigs: what a rig's own are expected to be beforehand."""

import numpy as np
from scipy.optimize import brentq
from scipy.special import digamma, polygamma
from threadpoolctl import threadpool_limits

from endoscope_lab.bench import report, side_by_side, table_head, table_row
from endoscope_lab.touch.touched_rig import SIMULATORS, free_tails


def run(seeds: range, jobs: int) -> None:
    """Print the excess of every joint, and the prior of all of them."""
    calls = [(simulator, seed) for seed in seeds for simulator in SIMULATORS]
    print(table_head('simulator', 'seed', 'excess, half-widths', 'clusters'))
    shares, clusters = [], []
    for number, (call, future) in enumerate(side_by_side(jobs, _tails, calls), 1):
        for _, excess, count, half in future.result():
            shares.append(excess / half)
            clusters.append(count)
            print(table_row(*call, f'{shares[-1]:.3f}', count))
        report(f'{number} of {len(calls)}')
    logarithms = np.log(shares)
    # An inverse gamma distribution by its moments, less what the count of clusters scatters.
    variance = float(np.var(logarithms, ddof=1) - np.mean(polygamma(1, clusters)))
    most = float(polygamma(1, 0.5))
    n = float(brentq(lambda k: polygamma(1, k) - min(variance, most), 0.5, 1e3))
    excess = float(np.exp(np.mean(logarithms) + digamma(n)) / n)
    print(f'PRIOR_EXCESS, PRIOR_CLUSTERS = {excess:.2f}, {n:.1f}')


def _tails(simulator: str, seed: int) -> list[tuple[float, float, int, float]]:
    with threadpool_limits(1):
        return free_tails(simulator, seed)
