"""Injected, sealed, explained, opened: the parts of a proof, and one proof from end to end."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from endoscope_bringup.cli import main
from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.recording import recording_from_bag
from endoscope_lab.concealed import motions
from endoscope_lab.concealed.another_rig import FEW_NODES, FORMS, Laws, drawn_laws, read
from endoscope_lab.concealed.judge import judged
from endoscope_lab.concealed.readings import as_sensed
from endoscope_lab.concealed.readings import read as read_of_kernel
from endoscope_lab.concealed.rigs import described_rig, true_rig
from endoscope_lab.concealed.strength import moved
from endoscope_lab.proof import SIMULATORS, SLAVE, sentences
from endoscope_lab.proof.drawing import drawn
from endoscope_lab.proof.slave import tracked
from endoscope_lab.proof.trial import (
    BrokenSealError,
    Outcome,
    Passage,
    SealedAnswer,
    SealedRig,
    opened,
    seal,
    write_bag,
)

SHORT = 9000
"""Ticks."""


@pytest.fixture(scope='module')
def rig():
    generator = np.random.default_rng(5)
    plant = true_rig(generator, described_rig(generator, 1))
    return plant, motions.commissioning(generator, 1)[:SHORT]


def test_without_a_law_the_other_simulator_reads_what_the_kernel_does(rig):
    plant, command = rig
    other = read(plant.joints['bend_x'], Laws(), command).channels()
    own = read_of_kernel(plant, command).channels()
    shaft, effort, *tensions, angle = (
        np.sqrt(np.mean((a - b) ** 2)) for a, b in zip(other, own, strict=True)
    )
    sensors = plant.sensors
    assert shaft < 1e-9
    assert effort < 0.1 * sensors.effort_noise
    assert max(tensions) < 0.3 * sensors.load_cell_noise
    assert angle < 0.1 * sensors.tracker_noise


@pytest.mark.parametrize('name', FORMS)
def test_a_law_is_nothing_at_zero_and_moves_what_is_read_at_one(name, rig):
    plant, command = rig
    joint = plant.joints['bend_x']
    bare = read(joint, Laws(), command, FEW_NODES)
    reached = float(np.abs(bare.bending).max())
    laws = drawn_laws(np.random.default_rng(1), name, 1e-3 * SHORT, reached)
    assert name in CATALOGUE
    assert moved(bare, read(joint, laws(0.0), command, FEW_NODES)) < 1e-12
    assert moved(bare, read(joint, laws(1.0), command, FEW_NODES)) > 1e-3


def test_a_recording_comes_back_from_its_bag(rig, tmp_path):
    plant, command = rig
    made = as_sensed(read_of_kernel(plant, command), plant.joint_names(), plant.sensors, 1)
    write_bag(made, tmp_path / 'rig.mcap')
    again = recording_from_bag(tmp_path / 'rig.mcap', plant)
    np.testing.assert_allclose(again.command.values, made.command.values)
    for name, series in made.measured().items():
        np.testing.assert_array_equal(getattr(again, name).values, series.values)
        np.testing.assert_allclose(getattr(again, name).time, series.time, atol=1e-9)


@pytest.mark.nightly
@pytest.mark.parametrize('form', SIMULATORS)
def test_the_same_seed_draws_the_same_rig(form):
    effect = 'load_cell_gain'
    (one, truth), (again, same) = (drawn(form, 3, 1, effect) for _ in range(2))
    assert [law.name for law in one.laws] == [effect]
    assert truth == same
    np.testing.assert_array_equal(one.recording.tension.values, again.recording.tension.values)
    assert one.moved > 0.05


def test_a_seal_is_the_digest_of_its_file_and_breaks_with_it(tmp_path):
    path = tmp_path / 'sealed.json'
    published = seal(path, {'concealed': ['gravity']})
    assert published == hashlib.sha256(path.read_bytes()).hexdigest()
    assert opened(path, published)['concealed'] == ['gravity']
    # The same truth has another digest each time, so that it cannot be guessed.
    assert seal(tmp_path / 'again.json', {'concealed': ['gravity']}) != published
    path.write_text(path.read_text().replace('gravity', 'cogging'))
    with pytest.raises(BrokenSealError, match='SHA-256'):
        opened(path, published)


def outcome(laws, reported, after=1.0):
    line = np.zeros(2)
    answer = SealedAnswer(
        1, 'So.', tuple(reported), 9.0, 5.0, after, Passage('s', 'N', line, line, {}), 1.0
    )
    rig = SealedRig(1, None, '', tuple(laws), frozenset(), 0.2)
    return Outcome(rig, answer, {}, judged(laws, answer.reported))


@pytest.mark.nightly
def test_a_proof_from_end_to_end(tmp_path, capsys):
    out = tmp_path / 'proof'
    command = f'prove --n 1 --seed 4 --effect load_cell_gain --out {out}'
    assert main(command.split()) == 0
    lines = capsys.readouterr().out.splitlines()
    sealed = next(k for k, line in enumerate(lines) if 'SHA-256' in line)
    named = next(k for k, line in enumerate(lines) if 'load_cell_gain' in line)
    assert sealed < named < lines.index('The seals are opened:')
    truth = out / 'rig_1' / 'sealed.json'
    assert lines[sealed].endswith(hashlib.sha256(truth.read_bytes()).hexdigest())
    assert json.loads(truth.read_text())['concealed'] == ['load_cell_gain']
    page = (out / 'index.html').read_text()
    assert '1 of 1 right' in page
    assert lines[sealed].split()[-1] in page
    assert (out / 'rig_1' / 'report' / 'report.html').is_file()


def test_a_slave_has_both_joints_and_nothing_that_spoils_recordings(capsys, tmp_path):
    for number in range(1, 7):
        case, truth = drawn(SLAVE, 11, number)
        assert case.true.joint_names() == case.described.joint_names() == ('bend_x', 'bend_y')
        assert all(law.stage != 'recording' for law in case.laws)
        assert list(truth['joints']) == ['bend_x', 'bend_y']
    for words, message in (
        ('--rig slave --effect clock_skew', '--effect clock_skew: with --form slave'),
        ('--rig slave --form other', 'mutually exclusive'),
        ('--form other --effect wire_creep', '--effect wire_creep: with --form other'),
    ):
        assert main(['prove', *words.split(), '--out', str(tmp_path / 'proof')]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / 'proof').exists()


@pytest.mark.nightly
def test_a_slave_follows_the_inverse_of_its_own_plant(tmp_path):
    plant = PlantDescription()
    run = tracked(plant, plant, tmp_path / 'tracked', 3)
    assert np.ptp(run.desired) > 0.8
    # The noise of the tracker is 0.25 deg.
    assert np.rad2deg(run.rmse) < 0.6
    with_tracking = replace(outcome([], []), tracking={'nominal': run, 'augmented': run})
    assert 'deg rms under the inverse of the described plant' in sentences.tracking(with_tracking)
