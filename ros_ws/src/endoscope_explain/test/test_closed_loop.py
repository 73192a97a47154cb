"""The slave of `endoscope bench closed_loop`."""

import numpy as np
import pytest

from endoscope_core.classifier.shipped import load_classifier
from endoscope_core.identification import load_class_parameters
from endoscope_core.signals import periodic_signal
from endoscope_explain.benchmark.closed_loop import (
    EXPLAINED,
    NOMINAL,
    WAYS,
    rig_of,
    run_closed_loop,
)
from endoscope_explain.generator import draw_case
from endoscope_explain.generator.concealed_physics import move
from endoscope_explain.generator.motions import GEAR
from endoscope_explain.generator.sensor_readings import TRACKER_NOISE


def test_the_slave_is_the_rig_that_was_recorded():
    case = draw_case(3, 'single', 'calibration', ('gravity',), 'bend_x')
    topics = {stream.topic: stream for stream in case.recordings['']}
    command, read = topics['slave/servo_jp'], topics['slave/measured_js']
    motion = move(rig_of(case.truth['rig']), GEAR * command.position)
    begin = command.stamps[0]
    tip = np.interp(
        (read.stamps - begin) * 1e-9, (command.stamps - begin) * 1e-9, motion.bending[:, 0]
    )
    wrong = read.position[:, 0] - tip
    assert np.std(wrong[20:]) < 1.3 * TRACKER_NOISE


def test_the_explained_inverse_tracks_better_than_the_described_one():
    signal = periodic_signal(2.5 * np.pi)
    found = run_closed_loop(
        1, 'gravity', signal, load_classifier(), load_class_parameters(), 'calibration'
    )
    assert found.named == ('gravity',)
    assert set(found.errors) == set(WAYS)
    assert found.errors[EXPLAINED] < 0.5 * found.errors[NOMINAL]
    assert found.errors[EXPLAINED] < np.deg2rad(3.0)
    assert found.errors[EXPLAINED] == pytest.approx(min(found.errors.values()))
