"""Draw concealed cases, explain them, and only then open what was concealed."""

import json
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from endoscope_core.plant import PlantDescription, load_plant
from endoscope_core.plant.on_stamps import AnswerStamps, answer_commands
from endoscope_core.worker_pool import worker_pool
from endoscope_explain.benchmark.outcome import Named, Outcome
from endoscope_explain.benchmark.peers import name_with_peers
from endoscope_explain.case import ExplainedCase
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.generator import CaseRequest, draw_case, write_case
from endoscope_explain.isolated_samples import with_isolated_marked
from endoscope_explain.observation import TICK, observe
from endoscope_explain.pipeline import Sources, explain_case, read_inputs
from endoscope_explain.predicted_signals import reading_lead, simulate_rig
from endoscope_explain.recording import Recording
from endoscope_explain.recording.signals import signal_name

LEAST_MOTION = 0.02
"""Commanded way in rad from which on a joint counts as moved."""


@dataclass(frozen=True)
class Task:
    """One case to be drawn and explained.

    Attributes
    ----------
    request : CaseRequest
    peers : bool
        Whether the peers are asked, too.
    """

    request: CaseRequest
    peers: bool


def run_case(task: Task) -> Outcome:
    """Draw a case, explain it, judge it on the second recording, and open the truth."""
    request = task.request
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        bag = write_case(
            draw_case(request.seed, request.stratum, request.motion, request.effects), folder
        )
        name = bag.stem
        baseline = folder / f'{name}.baseline.mcap'
        sources = Sources(
            bag,
            load_plant(folder / 'plant.yaml'),
            baseline if baseline.exists() else None,
            folder / f'{name}.second.mcap',
        )
        inputs = read_inputs(sources)
        case = explain_case(inputs, explain_recording, jobs=1, extras=False)
        peers = name_with_peers(case) if task.peers else {}
        second = inputs.validation
        if second is None:
            raise RuntimeError('the generator wrote no second recording')
        truth = json.loads((folder / f'{name}.truth.json').read_text())
        return Outcome(
            name,
            request.stratum,
            request.motion,
            str(case.verdict),
            case.places[0].stage if case.places else '',
            _named(case),
            truth,
            second_recording(
                with_isolated_marked(second, case.plant),
                case.explanation.nominal,
                case.explanation.augmented,
                moved_joints(case.recording),
            ),
            case.runtime_s,
            peers,
        )


def _named(case: ExplainedCase) -> tuple[Named, ...]:
    return tuple(
        Named(
            e.id,
            e.joint,
            e.stage,
            e.probability,
            e.alternatives,
            {k: (v.value, v.low, v.high) for k, v in e.parameters.items()},
        )
        for e in case.effects
    )


def moved_joints(recording: Recording) -> tuple[str, ...]:
    """Joints that were commanded to move: nothing is learnt of the others."""
    reach = np.ptp(recording.command.values, axis=0)
    return tuple(j for j, r in zip(recording.joints, reach, strict=True) if r > LEAST_MOTION)


def second_recording(
    recording: Recording,
    nominal: PlantDescription,
    augmented: PlantDescription,
    joints: Sequence[str],
) -> dict[str, tuple[float, float, float]]:
    """Compare two plants with a second recording, sample by sample.

    Parameters
    ----------
    recording : Recording
        As audited.
    nominal, augmented : PlantDescription
    joints : sequence of str
        Whose signals are compared.

    Returns
    -------
    dict of str to (float, float, float)
        For tensions and angles: rmse of each plant, and the noise.
    """
    observations = observe(recording, augmented)
    lead = reading_lead(observations, simulate_rig(observations, augmented)) * TICK
    errors = {
        name: _errors(recording, plant, lead, joints)
        for name, plant in (('nominal', nominal), ('augmented', augmented))
    }
    sensors = nominal.sensors
    noise = {'tension': sensors.load_cell_noise, 'bending': sensors.tracker_noise}
    return {
        signal: (
            errors['nominal'][signal],
            rmse,
            noise['bending' if signal.startswith('slave') else 'tension'],
        )
        for signal, rmse in errors['augmented'].items()
    }


def _errors(
    recording: Recording, plant: PlantDescription, lead: float, joints: Sequence[str]
) -> dict[str, float]:
    def stamps(time: np.ndarray) -> np.ndarray:
        return np.round(time * 1e9).astype(np.int64)

    tension, bending, command = recording.tension, recording.bending, recording.command
    answer = answer_commands(
        plant,
        stamps(command.time),
        command.values,
        AnswerStamps(stamps(tension.time), stamps(tension.time), stamps(bending.time)),
        read_delay=lead,
    )
    found = {}
    for joint in joints:
        j = recording.joints.index(joint)
        ok = bending.valid[:, j]
        wrong = (bending.values - answer.bending)[ok, j]
        found[signal_name('bending', joint)] = float(np.sqrt(np.mean(wrong**2)))
        for wire in range(2):
            ok = tension.valid[:, j, wire]
            wrong = (tension.values - answer.tension)[ok, j, wire]
            found[signal_name('tension', joint, wire)] = float(np.sqrt(np.mean(wrong**2)))
    return found


def run_cases(
    tasks: Sequence[Task], jobs: int, tell: Callable[[int, Outcome], None]
) -> Iterator[Outcome]:
    """Run cases side by side.

    Parameters
    ----------
    tasks : sequence of Task
    jobs : int
    tell : callable
        Told how many are done, and the last outcome.

    Yields
    ------
    Outcome
        As they are done. An error in a case ends the run; what is not done then is given up.
    """
    with worker_pool(jobs) as pool:
        futures = {pool.submit(run_case, task): task for task in tasks}
        for done, future in enumerate(as_completed(futures), 1):
            error = future.exception()
            if error is not None:
                error.add_note(f'in the case of seed {futures[future].request.seed}')
                raise error
            outcome = future.result()
            tell(done, outcome)
            yield outcome
