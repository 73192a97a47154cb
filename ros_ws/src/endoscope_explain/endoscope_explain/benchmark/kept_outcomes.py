"""Run a bench's cases, and keep their outcomes so that a long run can go on where it stopped."""

import random
from pathlib import Path

from endoscope_core.errors import EndoscopeError
from endoscope_explain.benchmark.outcome import Outcome, from_line, to_line
from endoscope_explain.benchmark.printing import progress_line
from endoscope_explain.benchmark.running import Task, run_cases
from endoscope_explain.generator import plan_cases


class KeptOutcomesError(EndoscopeError, ValueError):
    """A file of outcomes that cannot be used."""


def run_and_keep(
    cases: int, seed: int, jobs: int, peers: bool, keep: Path | None = None
) -> list[Outcome]:
    """Run the cases of a bench that were not run before.

    Parameters
    ----------
    cases, seed : int
        Choose the cases.
    jobs : int
        Processes side by side.
    peers : bool
        Whether the peers are asked on single effects under the commissioning motion.
    keep : Path, optional
        File of outcomes, one a line.

    Returns
    -------
    list of Outcome

    Raises
    ------
    KeptOutcomesError
        If `keep` holds something else, or `cases` is not positive.
    """
    if cases < 1:
        raise KeptOutcomesError(f'{cases} cases asked for: at least one is needed')
    requests = plan_cases(cases, seed)
    outcomes = _kept(keep) if keep is not None and keep.exists() else []
    wanted = {request.seed for request in requests}
    outcomes = [o for o in outcomes if o.truth['seed'] in wanted]
    done = {o.truth['seed'] for o in outcomes}
    tasks = [
        Task(r, peers and (r.stratum, r.motion) == ('single', 'commissioning'))
        for r in requests
        if r.seed not in done
    ]
    # In a mixed order, so that what an interrupted run has kept says something about every kind.
    random.Random(seed).shuffle(tasks)

    def tell(count: int, outcome: Outcome) -> None:
        print(progress_line(count + len(done), len(requests), outcome), flush=True)
        if keep is not None:
            with keep.open('a', encoding='utf-8') as file:
                file.write(to_line(outcome) + '\n')

    outcomes += list(run_cases(tasks, jobs, tell))
    return outcomes


def _kept(path: Path) -> list[Outcome]:
    try:
        return [from_line(line) for line in path.read_text(encoding='utf-8').splitlines()]
    except (ValueError, KeyError, TypeError) as error:
        raise KeptOutcomesError(f'{path} holds something else than outcomes: {error}') from error
