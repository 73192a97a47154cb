"""Rigs as described, and true rigs: other parameters, another sheath, other sensors."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.names import JOINTS
from endoscope_core.physics import JointParameters, PlantDescription, SensorParameters
from endoscope_core.physics.family import shipped_family
from endoscope_core.physics.layout import PROFILE_TERMS
from endoscope_explain.fit.free_parameters import SCALED_NOMINAL

Array = NDArray[np.float64]

MOST_RECORDED = math.radians(240.0)
"""Largest bend of the recorded tubes."""
OFF = 0.1
"""Half-width of the relative difference of a rig's parameters from its description."""
DRILLED = 0.01
"""The same for radii, where they differ as well."""
UNEVENNESS = 0.3
"""Rms difference of the first coefficient of a rig's friction profile; the next are smaller."""
TIGHTENING, REST_ANGLE, SPREAD = 0.15, 0.03, 0.25
"""Half-widths of differences: of the pretension's profile, of the rest angle of a joint and the
straight angle of its section in rad, and of the spread of its pre-sliding."""


def described_rig(generator: np.random.Generator, joints: int) -> PlantDescription:
    """A tube of the recorded family, as its engineer describes it."""
    joint = shipped_family().joint(generator.uniform(0.0, MOST_RECORDED))
    return PlantDescription(joints=dict.fromkeys(JOINTS[:joints], joint))


def true_rig(
    generator: np.random.Generator, described: PlantDescription, drilled: bool = False
) -> PlantDescription:
    """A healthy rig with parameters within 10 % of those described; radii within 1 % if drilled."""
    joints = {}
    for name, joint in described.joints.items():
        keys = (*SCALED_NOMINAL, 'pulley_radius', 'joint_radius') if drilled else SCALED_NOMINAL
        factors = {
            key: 1.0 + (DRILLED if key.endswith('radius') else OFF) * generator.uniform(-1.0, 1.0)
            for key in keys
        }
        terms = UNEVENNESS / np.arange(1, 4) * generator.standard_normal(3)
        tightened = joint.pretension_profile + TIGHTENING * generator.uniform(-1.0, 1.0)
        joints[name] = replace(
            joint,
            **{key: factor * getattr(joint, key) for key, factor in factors.items()},
            friction_profile=_sum(joint.friction_profile, terms),
            pretension_profile=float(np.clip(tightened, -1.0, 1.0)),
            joint_rest_angle=joint.joint_rest_angle + REST_ANGLE * generator.uniform(-1.0, 1.0),
            section_straight_angle=joint.section_straight_angle
            + REST_ANGLE * generator.uniform(-1.0, 1.0),
            joint_presliding_spread=joint.joint_presliding_spread + SPREAD * generator.uniform(),
        )
    return replace(described, joints=joints)


def other_sheath(generator: np.random.Generator, rig: PlantDescription) -> PlantDescription:
    """The rig with a tight bend, waves of friction, and a wide spread of pre-sliding."""
    joints = {}
    for name, joint in rig.joints.items():
        place, width = generator.uniform(0.2, 0.8), generator.uniform(0.08, 0.2)
        along = np.linspace(0.0, 1.0, 200)
        bend = generator.uniform(0.5, 1.3) * np.exp(-(((along - place) / width) ** 2))
        order = np.arange(1, PROFILE_TERMS + 1)
        terms = 2.0 * np.mean(bend * np.cos(np.pi * order[:, None] * along), axis=1)
        terms[-1] += generator.choice([-1.0, 1.0]) * generator.uniform(0.1, 0.4)
        joints[name] = replace(
            joint,
            friction_profile=_sum(joint.friction_profile, terms),
            joint_presliding_spread=generator.uniform(0.6, 1.4),
        )
    return replace(rig, joints=joints)


def coarse_sensors(generator: np.random.Generator) -> SensorParameters:
    """Sensors with a coarser resolution than described."""
    return replace(
        SensorParameters(),
        load_cell_resolution=generator.uniform(0.02, 0.06),
        effort_resolution=generator.uniform(0.005, 0.01),
        encoder_counts=float(generator.choice([1024.0, 2048.0])),
    )


def spreads(joint: JointParameters) -> dict[str, float]:
    """Rms difference of each parameter of a rig from its description; `friction_profile_1`..."""
    uniform = 1.0 / math.sqrt(3.0)
    return {
        **{key: OFF * uniform * getattr(joint, key) for key in SCALED_NOMINAL},
        'pretension_profile': -TIGHTENING * uniform,
        'joint_rest_angle': REST_ANGLE * uniform,
        'section_straight_angle': REST_ANGLE * uniform,
        'joint_presliding_spread': SPREAD * uniform,
        **{f'friction_profile_{k}': UNEVENNESS / k for k in (1, 2, 3)},
    }


def with_number(joint: JointParameters, key: str, added: float) -> JointParameters:
    """The joint with an offset of one of the parameters that `spreads` names."""
    if key.startswith('friction_profile_'):
        term = np.zeros(int(key[-1]))
        term[-1] = added
        return replace(joint, friction_profile=_sum(joint.friction_profile, term))
    changed: dict[str, Any] = {key: getattr(joint, key) + added}
    return replace(joint, **changed)


def _sum(profile: tuple[float, ...], terms: Array) -> tuple[float, ...]:
    size = max(len(profile), len(terms))
    return tuple(
        (np.pad(profile, (0, size - len(profile))) + np.pad(terms, (0, size - len(terms)))).tolist()
    )
