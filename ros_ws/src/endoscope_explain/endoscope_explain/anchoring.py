"""The nominal plant fitted to every joint of a recording: where all searches begin."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.layout import OUT_JOINT
from endoscope_explain.compose import nominal_anchors
from endoscope_explain.fit.free_parameters import BAND
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.simulated_joint import packed_joint, simulate_joint
from endoscope_explain.isolated_samples import without_isolated
from endoscope_explain.observation import JointObservation, couple
from endoscope_explain.parallel import parallel_map
from endoscope_explain.recording import Recording

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def anchored(
    recording: Recording,
    observations: tuple[JointObservation, ...],
    plant: PlantDescription,
    band: float,
    jobs: int,
) -> tuple[tuple[JointObservation, ...], list[tuple[Fit, Fit]]]:
    """Fit the nominal plant, and once more where that shows isolated wrong samples.

    Parameters
    ----------
    recording : Recording
        Tells which samples the audit found wrong.
    observations : tuple of JointObservation
        Of the recording.
    plant : PlantDescription
        In health.
    band : float
        Relative tolerance of its parameters.
    jobs : int
        Tasks side by side.

    Returns
    -------
    observations : tuple of JointObservation
        Without the samples that stick out.
    anchors : list of (Fit, Fit)
        Of each joint, refitted and as described.
    """
    packed = {o.joint: packed_joint(plant, o.joint) for o in observations}
    anchors = all_anchors(observations, packed, jobs, band)
    cleaned = without_isolated(recording, observations, tuple(fitted for fitted, _ in anchors))
    if cleaned is observations:
        return observations, anchors
    return cleaned, all_anchors(cleaned, packed, jobs, band)


def all_anchors(
    observations: tuple[JointObservation, ...],
    packed: dict[str, tuple[Array, Flags]],
    jobs: int,
    band: float = BAND,
) -> list[tuple[Fit, Fit]]:
    """Refit the nominal plant of every joint, and let the joints see each other's angle."""
    anchors = parallel_map(lambda o: nominal_anchors(o, *packed[o.joint], band), observations, jobs)
    couple(observations, tuple(simulated_bending(fitted) for fitted, _ in anchors))
    return anchors


def simulated_bending(fitted: Fit) -> Array:
    """Bending angle (N,) in rad of a fitted joint at every tick of its recording."""
    parameters, _ = fitted.model.packed(fitted.theta)
    return simulate_joint(fitted.model.observation, parameters, fitted.model.flags)[:, OUT_JOINT]
