"""Data sets of simulated calibrations, for the classifier and its benchmarks."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.atomic_output import atomic_directory
from endoscope_core.errors import FileError, InputError
from endoscope_core.physics import PlantDescription, SensorModel, simulate
from endoscope_core.signals import CALIBRATION_RATE, SINUSOID, CalibrationMotion, calibration_motion
from endoscope_lab.dataset.rig_variation import (
    GREATEST_UNEVENNESS,
    Instrument,
    TubeConfiguration,
    calibration_command,
    configuration_of_size,
    random_instrument,
    with_pretension_reset,
)

CLASSES_DEG = (40, 50, 60, 70, 80, 90, 100)
"""Classes of backlash size that the classifier distinguishes, deg."""
PER_CLASS = 30
SIZE_SPREAD_DEG = 1.0
ARRAYS_FILE = 'recordings.npz'
MANIFEST_FILE = 'manifest.json'
_MOST_RIGS = 1000


@dataclass(frozen=True)
class CalibrationRecording:
    """The data of equation 2 of the first paper, N samples at 1 kHz, J = 2 joints.

    N = 9000 for the first paper's sinusoid.
    """

    tension: NDArray[np.float64]  # N, in the order x_pos, x_neg, y_pos, y_neg
    # rad and rad/s, the same for both joints.
    desired_angle: NDArray[np.float64]
    desired_velocity: NDArray[np.float64]
    # rad; the tracker's 40 readings a second, joined by straight lines.
    actual_angle: NDArray[np.float64]


def record_calibration(
    plant: PlantDescription, seed: int, motion: CalibrationMotion | None = None
) -> CalibrationRecording:
    """Simulate the calibration of both joints, by default the sinusoid, read by noisy sensors."""
    motion = motion or calibration_motion()
    trajectory = simulate(plant, calibration_command(plant, motion))
    sensors = SensorModel(plant.sensors, seed)
    angle, velocity = motion.signal(trajectory.time)
    wires = trajectory.tension.reshape(len(trajectory.time), -1)
    every = round(CALIBRATION_RATE / plant.sensors.tracker_rate)
    readings = sensors.bending(trajectory.bending[::every])
    actual = [np.interp(trajectory.time, trajectory.time[::every], r) for r in readings.T]
    return CalibrationRecording(sensors.tension(wires), angle, velocity, np.stack(actual, axis=1))


@dataclass(frozen=True)
class CalibrationDataset:
    """R recordings of calibrations, N samples at 1 kHz, J = 2 joints.

    N = 9000 for the first paper's sinusoid, less for a brief calibration.
    """

    tension: NDArray[np.float32]  # N
    # rad and rad/s.
    desired_angle: NDArray[np.float64]
    desired_velocity: NDArray[np.float64]
    actual_angle: NDArray[np.float32]  # rad, from the tracker
    class_deg: NDArray[np.int64]  # class of the backlash size
    joint_size: NDArray[np.float64]  # true backlash size in rad of each joint under the sinusoid
    configuration: NDArray[np.int64]  # number of the tube configuration, by which folds are grouped
    manifest: dict[str, Any]  # seed, spreads, plants; see `manifest_hash`

    @property
    def backlash_size(self) -> NDArray[np.float64]:
        """True backlash size in rad of each recording, mean of both joints (R,)."""
        return np.mean(self.joint_size, axis=1)

    @property
    def motion(self) -> str:
        """Name of the calibration motion that was recorded."""
        return str(self.manifest['motion'])

    @property
    def manifest_hash(self) -> str:
        """SHA-256 of the manifest, which holds a hash of the arrays."""
        text = json.dumps(self.manifest, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def make_dataset(
    seed: int,
    per_class: int = PER_CLASS,
    progress: Callable[[int, int], None] | None = None,
    motion: str = SINUSOID,
    *,
    one_instrument: bool = False,
    reset_pretension: bool = False,
) -> CalibrationDataset:
    """Simulate the data set; each recording is of another tube.

    The same seed gives the same recordings; a larger `per_class` adds further ones. Rigs, tubes and
    sizes do not depend on the recorded `motion`: the size is always that under the sinusoid. All
    recordings may be of `one_instrument`, whose pretension may be set again before each recording.
    `progress` is called with the numbers of finished and of all recordings.

    EndoscopeError if `per_class` is not positive or `seed` is negative, if the pretension of many
    instruments is to be reset, or for an unknown motion.
    """
    calibration = calibration_motion(motion)
    if per_class < 1 or seed < 0:
        raise InputError(f'per_class = {per_class} must be positive and seed = {seed} not negative')
    if reset_pretension and not one_instrument:
        raise InputError('the pretension is set again for each recording of many instruments')
    instrument = _of_all_classes(seed) if one_instrument else None
    total = per_class * len(CLASSES_DEG)
    configurations: list[TubeConfiguration] = []
    recordings = []
    classes: list[int] = []
    for class_deg in CLASSES_DEG:
        for k in range(per_class):
            generator = np.random.default_rng([seed, class_deg, k])
            configuration = _draw(generator, class_deg, instrument, reset_pretension)
            noise_seed = int(generator.integers(2**31))
            recordings.append(record_calibration(configuration.plant, noise_seed, calibration))
            configurations.append(configuration)
            classes.append(class_deg)
            if progress is not None:
                progress(len(recordings), total)
    arrays: dict[str, NDArray[Any]] = {
        'tension': np.stack([r.tension for r in recordings]).astype(np.float32),
        'desired_angle': recordings[0].desired_angle,
        'desired_velocity': recordings[0].desired_velocity,
        'actual_angle': np.stack([r.actual_angle for r in recordings]).astype(np.float32),
        'class_deg': np.array(classes, dtype=np.int64),
        'joint_size': np.array([c.joint_sizes for c in configurations]),
        'configuration': np.arange(total, dtype=np.int64),
    }
    manifest = {
        'schema': 3,
        'motion': motion,
        'seed': seed,
        'per_class': per_class,
        'classes_deg': list(CLASSES_DEG),
        'size_spread_deg': SIZE_SPREAD_DEG,
        'arrays_sha256': _arrays_hash(arrays),
        'recordings': [
            {
                'configuration': k,
                'class_deg': classes[k],
                'backlash_size': configuration.backlash_size,
                'bend': configuration.bend,
                'unevenness': configuration.unevenness,
                'joints': {
                    name: asdict(joint) for name, joint in configuration.plant.joints.items()
                },
            }
            for k, configuration in enumerate(configurations)
        ],
    }
    if one_instrument:
        manifest |= {'instruments': 'one', 'reset_pretension': reset_pretension}
    return CalibrationDataset(**arrays, manifest=manifest)


def save_dataset(dataset: CalibrationDataset, folder: str | Path) -> None:
    """Write a data set to a new folder, whole or not at all.

    OutputError if there is something at `folder` already.
    """
    arrays = {name: value for name, value in vars(dataset).items() if name != 'manifest'}
    with atomic_directory(folder) as partial:
        np.savez_compressed(partial / ARRAYS_FILE, **arrays)
        text = json.dumps(dataset.manifest, indent=1, sort_keys=True)
        (partial / MANIFEST_FILE).write_text(text + '\n', encoding='utf-8')


def is_dataset(folder: str | Path) -> bool:
    """Whether `folder` looks like a data set rather than a bag."""
    return (Path(folder) / MANIFEST_FILE).is_file()


def load_dataset(folder: str | Path) -> CalibrationDataset:
    """Read a data set.

    FileError if the folder holds none, or its arrays are not those that the manifest was written
    for.
    """
    folder = Path(folder)
    for name in (MANIFEST_FILE, ARRAYS_FILE):
        if not (folder / name).is_file():
            raise FileError(
                f'{folder} is no data set: it has no {name}; make one with `endoscope dataset`'
            )
    try:
        manifest = json.loads((folder / MANIFEST_FILE).read_text(encoding='utf-8'))
        with np.load(folder / ARRAYS_FILE, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        intact = _arrays_hash(arrays) == manifest['arrays_sha256']
        dataset = CalibrationDataset(**arrays, manifest=manifest)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f'{folder} cannot be read as a data set: {error}') from error
    if not intact:
        raise FileError(f'{folder}: {ARRAYS_FILE} is not what {MANIFEST_FILE} was written for')
    return dataset


def _draw(
    generator: np.random.Generator,
    class_deg: int,
    instrument: Instrument | None,
    reset_pretension: bool,
) -> TubeConfiguration:
    size = np.deg2rad(class_deg + SIZE_SPREAD_DEG * generator.uniform(-1.0, 1.0))
    for _ in range(_MOST_RIGS):
        unevenness = float(generator.uniform(-GREATEST_UNEVENNESS, GREATEST_UNEVENNESS))
        used = instrument or random_instrument(generator)
        if reset_pretension:
            used = with_pretension_reset(used, generator)
        configuration = configuration_of_size(used, float(size), unevenness)
        if configuration is not None:
            return configuration
    raise InputError(f'no instrument of {_MOST_RIGS} reaches a backlash size of {class_deg} deg')


def _of_all_classes(seed: int) -> Instrument:
    """An instrument that has the smallest and the largest size in some tube.

    In evenly bent tubes hardly any has both, so that the unevenness of the friction is used too.
    """
    uneven = 0.75 * GREATEST_UNEVENNESS
    ends = (CLASSES_DEG[0] - SIZE_SPREAD_DEG, uneven), (CLASSES_DEG[-1] + SIZE_SPREAD_DEG, -uneven)
    generator = np.random.default_rng(seed)
    for _ in range(_MOST_RIGS):
        instrument = random_instrument(generator)
        if all(configuration_of_size(instrument, float(np.deg2rad(x)), u) for x, u in ends):
            return instrument
    raise InputError(f'no instrument of {_MOST_RIGS} reaches all backlash sizes')


def _arrays_hash(arrays: dict[str, NDArray[Any]]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()
