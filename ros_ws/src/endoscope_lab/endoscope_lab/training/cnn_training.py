"""Trains the classifier on simulated rigs, and calibrates it on rigs held out."""

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.classifier.cnn_classifier import (
    LEAST_DEVIATION,
    MIDDLE,
    OWN_OUTPUTS,
    UNIT,
    CnnClassifier,
    evaluated,
    first,
    logarithm,
    stretched,
)
from endoscope_core.errors import EndoscopeError
from endoscope_lab.dataset import CLASSES_DEG
from endoscope_lab.dataset.training_rigs import (
    TrainingRigs,
    strange_rigs,
    training_rigs,
)
from endoscope_lab.training.held_out_calibration import (
    STRANGE,
    SUBTLE,
    Report,
    calibrated,
    counted,
    read,
    read_of_all_kinds,
)
from endoscope_lab.training.network import TensionCnn, Tensor, nn, torch

Array = NDArray[np.float64]
Single = NDArray[np.float32]

KEPT_EVERY = 500
"""Steps between checkpoints, from which the training can resume."""
_STANDARD = 256
_WHITENED = 2048
_RIDGE = 1e-3
_LEAST_RIGS, _LEAST_STEPS = 40, 10


@dataclass(frozen=True)
class CnnTraining:
    """Settings of simulation and training."""

    rigs: int = 5000  # simulated rigs for training
    strange: int = 500  # recordings of slack wires and other motions
    held_out: int = 1000  # rigs on which intervals and refusals are calibrated
    steps: int = 6000  # of AdamW
    batch: int = 64  # recordings in each step
    warm_up: int = 600  # first steps, in which size is learnt by squared error, then by likelihood
    spoilt: float = 0.15  # share of a batch that belongs to no tube
    learning_rate: float = 4e-3  # peak of one cycle
    smoothing: float = 0.02  # of the labels

    @classmethod
    def of_size(cls, rigs: int, steps: int) -> 'CnnTraining':
        """Settings by numbers of rigs and steps; EndoscopeError if these are too few."""
        if rigs < _LEAST_RIGS or steps < _LEAST_STEPS:
            raise EndoscopeError(
                f'--n {rigs} and --steps {steps}: at least {_LEAST_RIGS} rigs and {_LEAST_STEPS} '
                'steps are needed'
            )
        return cls(rigs, rigs // 10, rigs // 5, steps, warm_up=steps // 10)


@dataclass(frozen=True)
class TrainedCnn:
    """A classifier, and the record of its training."""

    classifier: CnnClassifier
    # Results on rigs held out, for each instrument and reading rate: share of right classes, rms
    # error of the size in deg, share of sizes in their interval, and of rigs refused. Half of the
    # rigs calibrate the intervals, the other half is judged by them.
    held_out: dict[str, dict[str, float]]
    curve: list[tuple[int, float]]  # steps, and mean loss since the last entry


def train_cnn(
    motion: str,
    seed: int,
    settings: CnnTraining | None = None,
    kept: Path | None = None,
    report: Report = lambda _: None,
) -> TrainedCnn:
    """Simulate, train and calibrate; the same seed on the same machine gives the same weights.

    The file `kept` is a checkpoint, from which an interrupted training resumes.
    """
    settings = settings or CnnTraining()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    begin = first(motion)
    sources = (
        ('rigs to train with', training_rigs, settings.rigs),
        ('strange recordings', strange_rigs, settings.strange),
    )
    known, strange = (
        make(seed, count, motion, begin, counted(report, name)) for name, make, count in sources
    )
    source = {'motion': motion, 'seed': seed}
    network, curve = _trained(known, strange, source, settings, kept, report)
    weights = network.weights() | _white(network, known, seed)
    return TrainedCnn(*calibrated(weights, motion, seed, settings.held_out, report), curve)


def description_of(trained: TrainedCnn, settings: CnnTraining, seed: int, command: str) -> dict:
    """Content of the file that describes the weights."""
    return {
        'motion': trained.classifier.motion,
        'classes_deg': list(CLASSES_DEG),
        **asdict(trained.classifier.calibration),
        'command': command,
        'date': datetime.now(UTC).date().isoformat(),
        'seed': seed,
        'training': asdict(settings),
        'held_out': trained.held_out,
        'curve': [[step, round(loss, 4)] for step, loss in trained.curve],
    }


def loss_of(outputs: Tensor, size: Tensor, smoothing: float, warm: bool) -> Tensor:
    """Mean loss of outputs (B, 10) for sizes (B,) in rad, NaN where there is no tube.

    Cross-entropy of the classes, squared error or Gaussian likelihood of the size, and binary
    cross-entropy of 'none of these'.
    """
    classes = len(CLASSES_DEG)
    none = torch.isnan(size)
    loss = nn.functional.binary_cross_entropy_with_logits(outputs[:, -1], none.float())
    predicted, true = outputs[~none], size[~none]
    centres = torch.deg2rad(torch.tensor(CLASSES_DEG, dtype=true.dtype, device=true.device))
    nearest = torch.argmin((true[:, None] - centres).abs(), dim=1)
    logits = predicted[:, :classes]
    loss = loss + nn.functional.cross_entropy(logits, nearest, label_smoothing=smoothing)
    error = predicted[:, classes] - (true - MIDDLE) / UNIT
    if warm:
        return loss + torch.mean(error**2)
    deviation = LEAST_DEVIATION / UNIT + torch.exp(predicted[:, classes + 1])
    return loss + torch.mean(torch.log(deviation) + 0.5 * (error / deviation) ** 2)


def batch_of(
    known: TrainingRigs,
    strange: TrainingRigs,
    settings: CnnTraining,
    generator: np.random.Generator,
) -> tuple[Single, Array]:
    """Courses (B, 6561, 4) and sizes (B,) of one batch."""
    rows = generator.integers(len(known.size), size=settings.batch)
    tension, size = known.tension[rows], known.size[rows]
    kinds = [*STRANGE.values(), *SUBTLE]
    spoilt = generator.permutation(settings.batch)[: round(settings.batch * settings.spoilt)]
    size[spoilt] = np.nan
    strangers = spoilt[: len(spoilt) // 3]
    tension[strangers] = strange.tension[
        generator.integers(len(strange.tension), size=len(strangers))
    ]
    # Half before a cell's noise, as an amplifier clips, half after it, as a converter does.
    early, late = np.array_split(spoilt[len(strangers) :], 2)
    for row in early:
        tension[row] = kinds[generator.integers(len(kinds))](tension[row], generator)
    readings = read_of_all_kinds(tension, generator)
    for row in late:
        readings[row] = kinds[generator.integers(len(kinds))](readings[row], generator)
    return logarithm(stretched(readings)), size


def _trained(
    known: TrainingRigs,
    strange: TrainingRigs,
    source: dict[str, Any],
    settings: CnnTraining,
    kept: Path | None,
    report: Report,
) -> tuple[TensionCnn, list[tuple[int, float]]]:
    seed = source['seed']
    torch.manual_seed(seed)
    device = 'cuda' if torch.cuda.is_available() else 'cpu'
    network = TensionCnn(len(CLASSES_DEG) + OWN_OUTPUTS)
    some = read(known.tension[:_STANDARD], np.random.default_rng([seed, 4]))
    network.standardise_by(_as_input(logarithm(stretched(some))))
    network.to(device)
    optimiser = torch.optim.AdamW(network.parameters(), lr=settings.learning_rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, settings.learning_rate, total_steps=settings.steps
    )
    begin, curve = 0, []
    parts: dict[str, Any] = {'network': network, 'optimiser': optimiser, 'schedule': schedule}
    made = source | asdict(settings)
    if kept is not None and kept.is_file():
        state = torch.load(kept, weights_only=True, map_location=device)
        if state['made'] == made:
            for name, part in parts.items():
                part.load_state_dict(state[name])
            begin, curve = state['step'], state['curve']
            report(f'resumes after step {begin} of {settings.steps}')
    network.train()
    losses = []
    for step in range(begin, settings.steps):
        generator = np.random.default_rng([seed, 5, step])
        courses, size = batch_of(known, strange, settings, generator)
        optimiser.zero_grad()
        warm = step < settings.warm_up
        loss = loss_of(
            network(_as_input(courses).to(device)),
            torch.from_numpy(size.astype(np.float32)).to(device),
            settings.smoothing,
            warm,
        )
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        losses.append(loss.item())
        if (step + 1) % KEPT_EVERY == 0 or step + 1 == settings.steps:
            curve.append((step + 1, float(np.mean(losses))))
            losses = []
            if kept is not None:
                state = {name: part.state_dict() for name, part in parts.items()}
                torch.save(state | {'step': step + 1, 'curve': curve, 'made': made}, kept)
            report(f'step {step + 1} of {settings.steps}: loss {curve[-1][1]:.3f}')
    network.eval().cpu()
    return network, curve


def _white(network: TensionCnn, known: TrainingRigs, seed: int) -> dict[str, Single]:
    """Mean of the features in training, and their whitening matrix."""
    some = read_of_all_kinds(known.tension[:_WHITENED], np.random.default_rng([seed, 7]))
    features = np.concatenate(
        [
            evaluated(network.weights(), logarithm(stretched(part)))[1]
            for part in np.array_split(some, max(1, len(some) // 64))
        ]
    )
    covariance = np.cov(features.T)
    covariance += _RIDGE * np.mean(np.diag(covariance)) * np.eye(len(covariance))
    whitening = np.linalg.cholesky(np.linalg.inv(covariance))
    return {
        'centre': features.mean(axis=0).astype(np.float32),
        'whitening': np.ascontiguousarray(whitening, dtype=np.float32),
    }


def _as_input(courses: Single) -> Tensor:
    return torch.from_numpy(courses).transpose(1, 2).contiguous()
