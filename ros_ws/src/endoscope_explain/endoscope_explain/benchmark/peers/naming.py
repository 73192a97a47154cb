"""What each peer names on a case, from the residual of the refitted nominal plant."""

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_explain.benchmark.peers.forward_selection import name_by_forward_selection
from endoscope_explain.benchmark.peers.sindy import name_by_sindy
from endoscope_explain.benchmark.peers.symbolic import name_by_symbolic_regression
from endoscope_explain.benchmark.peers.term_library import problem_of
from endoscope_explain.case import ExplainedCase
from endoscope_explain.predicted_signals import RecordedView, view

PEERS = {
    'pysindy': name_by_sindy,
    'pyoperon': name_by_symbolic_regression,
    'forward selection': name_by_forward_selection,
}


def name_with_peers(case: ExplainedCase) -> dict[str, str]:
    """Ask every peer about a case.

    Parameters
    ----------
    case : ExplainedCase

    Returns
    -------
    dict of str to str
        Effect by peer; `nothing` where it named none.
    """
    recorded = view(case.recording, {'refitted': case.explanation.refitted})
    problem = problem_of(recorded, _loudest_joint(recorded), 'refitted')
    # Several processes share the machine, and matrices this small gain nothing from threads.
    with threadpool_limits(1):
        return {name: peer(problem) for name, peer in PEERS.items()}


def _loudest_joint(recorded: RecordedView) -> str:
    misfit = {
        joint: max(float(np.mean(v.residual('refitted') ** 2)) for v in recorded.of_joint(joint))
        for joint in recorded.joints
    }
    return max(misfit, key=lambda joint: misfit[joint])
