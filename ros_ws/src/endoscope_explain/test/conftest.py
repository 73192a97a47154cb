"""Recordings of the plant made in memory."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.sensing import SensorModel
from endoscope_core.physics.simulator import simulate
from endoscope_core.rig import shipped_rig
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import Inputs, Sources
from endoscope_explain.explanation import (
    Estimate,
    Explanation,
    NamedEffect,
    NominalEstimate,
    UnknownTerm,
    Verdict,
)
from endoscope_explain.observe.predicted_signals import fits_by, view
from endoscope_explain.pipeline import explain_case
from endoscope_explain.recording import RigRecording, Series

# Tests import each other's recordings by name.
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(autouse=True)
def explained_once(corpus):
    """Refuse the engine what the corpus has not."""


TICK = 1e-3
TRACKER_EVERY = 25


def make_recording(
    plant: PlantDescription | None = None,
    duration: float = 12.0,
    seed: int = 1,
    command: np.ndarray | None = None,
) -> RigRecording:
    """Sensors' readings of a plant under a shaft command, or swept, stepped and held."""
    plant = plant or PlantDescription()
    n = int(duration / TICK) if command is None else len(command)
    time = TICK * np.arange(n)
    joints = plant.joint_names()
    swept = 0.9 * np.sin(1.3 * time)
    stepped = np.where((time % 3.0) < 1.5, 0.5, -0.4)
    if command is None:
        command = np.stack([swept if k == 0 else stepped for k in range(len(joints))], axis=1)
        command *= shipped_rig().joints.gear
    truth = simulate(plant, command)
    sensors = SensorModel(plant.sensors, seed)
    tracker = slice(None, None, TRACKER_EVERY)
    return RigRecording(
        'synthetic',
        0.0,
        joints,
        Series.of('motor/servo_jp', time, command),
        Series.of('wires/measured_js', time, sensors.tension(truth.tension)),
        Series.of('slave/measured_js', time[tracker], sensors.bending(truth.bending[tracker])),
        Series.of('motor/measured_js', time, sensors.shaft_position(truth.shaft_position)),
        Series.of('motor/measured_js', time, sensors.shaft_velocity(truth.shaft_velocity)),
        Series.of('motor/measured_js', time, sensors.shaft_effort(truth.shaft_effort)),
    )


@pytest.fixture(scope='session')
def record():
    """The function `make_recording`."""
    return make_recording


EXPLAINED = EffectSpec('stribeck_friction', 'bend_x', {'rise': 0.8, 'stribeck_speed': 2e-3})


@pytest.fixture(scope='session')
def stribeck_recording():
    """A recording of a plant with `EXPLAINED`."""
    return make_recording(PlantDescription(effects=(EXPLAINED,)), duration=15.0)


@pytest.fixture(scope='session')
def stribeck_case(stribeck_recording):
    """The recording with `EXPLAINED`, explained by the truth itself."""
    plant = PlantDescription()
    audit = audit_recording(stribeck_recording, plant)
    augmented = dataclasses.replace(plant, effects=(EXPLAINED,))
    recorded = view(audit.recording, {'nominal': plant, 'refitted': plant, 'augmented': augmented})
    effect = NamedEffect(
        EXPLAINED.id,
        EXPLAINED.joint,
        {name: Estimate(v, 0.9 * v, 1.1 * v, '-') for name, v in EXPLAINED.parameters.items()},
        ('viscous_friction',),
        {'gain': 120.0},
    )
    parameters = {
        joint: {'capstan_exponent': NominalEstimate(0.9, 0.88, 0.92, '-', 0.9, True)}
        for joint in plant.joints
    }
    explanation = Explanation(
        verdict=Verdict.MISSING_PHYSICS,
        effects=(effect,),
        parameters=parameters,
        nominal=plant,
        refitted=plant,
        augmented=augmented,
        fit={name: fits_by(recorded, name) for name in ('nominal', 'refitted', 'augmented')},
    )
    inputs = Inputs(Sources(Path('synthetic'), plant, quick=True), audit)
    return explain_case(inputs, lambda *_, **__: explanation)


@pytest.fixture(scope='session')
def missing_function():
    """A function that no effect of the catalogue is, as an explanation has it."""
    return UnknownTerm(
        'bend_x',
        'load_of_angle',
        np.linspace(-1.0, 1.0, 41),
        np.linspace(-1.0, 1.0, 41) ** 2,
        np.full(41, 0.05),
        '0.98*q**2',
        0.98 * np.linspace(-1.0, 1.0, 41) ** 2,
        0.99,
        True,
        0.9,
        ('tracker_of_angle',),
        ('gravity',),
    )
