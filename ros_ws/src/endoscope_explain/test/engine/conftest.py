"""Recordings of our own simulated rig, for tests of the engine."""

from types import SimpleNamespace

import numpy as np
import pytest

from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_core.rig import shipped_rig


def short_motion(duration: float = 12.0) -> np.ndarray:
    """Desired bending (N,) in rad: sinusoid, steps with holds, chirp."""
    t = np.arange(int(duration * 1000)) * 1e-3
    sinusoid = 1.2 * np.sin(2.0 * t)
    steps = 0.5 * np.sign(np.sin(2.5 * (t - 5.0)))
    chirp = 0.7 * np.sin(1.5 * (t - 9.0) ** 2)
    return np.where(t < 5.0, sinusoid, np.where(t < 9.0, steps, chirp))


def rig(*effects, **changed: float) -> PlantDescription:
    """A rig with one joint, with effects and other parameters than nominal."""
    return PlantDescription(joints={'bend_x': JointParameters(**changed)}, effects=tuple(effects))


@pytest.fixture(scope='session')
def one_joint(record):
    """Makes rigs of one joint, motions and recordings of them."""

    def asked(plant, command, seed=1):
        """What a rig's sensors read that is asked to bend: (N,), or (N, joints)."""
        shaft = command.reshape(len(command), -1) * shipped_rig().joints.gear
        return record(plant, seed=seed, command=shaft)

    return SimpleNamespace(rig=rig, record=asked, motion=short_motion)
