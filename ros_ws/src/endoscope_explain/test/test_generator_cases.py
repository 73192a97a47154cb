"""Drawn cases: what is in them, that they repeat, and that their bags open like any other."""

import json
import math

import numpy as np
import pytest

from endoscope_bags import open_bag
from endoscope_explain.generator import (
    EFFECTS,
    MOTIONS,
    OUTSIDE,
    STRATA,
    draw_case,
    plan_cases,
    write_case,
)
from endoscope_explain.generator.draw import main
from endoscope_explain.generator.sensor_readings import FIRST_STAMP

COMPARABLE = {
    'transport_delay': {'delay_s'},
    'actuator_lag': {'time_constant_s'},
    'rate_limit': {'limit_rad_per_s'},
    'gear_backlash': {'gap_rad'},
    'pretension_loss': {'rate_n_per_s'},
    'configuration_change': {'time_s'},
    'joint_backlash': {'gap_rad'},
    'joint_stop': {'angle_rad'},
    'contact': {'angle_rad'},
    'external_load': {'moment_nm', 'time_s'},
    'breathing': {'frequency_hz'},
    'tracker_bias': {'bias_rad'},
    'tracker_delay': {'delay_s'},
    'tracker_drift': {'rate_rad_per_s'},
    'load_cell_drift': {'rate_n_per_s'},
    'load_cell_gain': {'gain'},
    'load_cell_saturation': {'limit_n'},
    'clock_skew': {'skew'},
    'recording_gap': {'time_s'},
}
NOISE = {'motor/measured_js': 5e-4, 'wires/measured_js': 0.02, 'slave/measured_js': 0.00436}


def by_topic(streams):
    return {stream.topic: stream for stream in streams}


def rig_alone(case):
    """Readings without noise of the case's first motion by its rig with nothing concealed."""
    from endoscope_explain.generator.concealed_physics import move
    from endoscope_explain.generator.motions import GEAR
    from endoscope_explain.generator.rig import JOINTS, NOMINAL, nominal_rig

    rig = nominal_rig()
    for joint, name in enumerate(JOINTS):
        for key in NOMINAL:
            rig[key][joint] = case.truth['rig'][name][key]
    command = by_topic(case.recordings[''])['slave/servo_jp'].position
    motion = move(rig, GEAR * np.vstack([command, command[-1:]]))
    return {
        'motor/measured_js': motion.shaft_angle[1:],
        'wires/measured_js': motion.tension[1:],
        'slave/measured_js': motion.bending[1::25],
    }


def excess(case):
    """Root mean square difference to the rig alone, in units of noise, by topic and column."""
    out = {}
    for topic, healthy in rig_alone(case).items():
        stream = by_topic(case.recordings[''])[topic]
        values = stream.effort if topic.startswith('wires') else stream.position
        index = np.round((stream.stamps - FIRST_STAMP) / 1e6).astype(int)
        index = np.minimum(index // (25 if topic.startswith('slave') else 1), len(healthy) - 1)
        out[topic] = np.sqrt(np.mean((values - healthy[index]) ** 2, axis=0)) / NOISE[topic]
    return out


@pytest.mark.parametrize('name', sorted(EFFECTS))
def test_an_effect_shows_from_its_stage_on_and_nowhere_before(name):
    case = draw_case(5, 'single', 'calibration', effects=(name,))
    (concealed,) = case.truth['concealed']
    assert case.truth['effects'] == [name]
    assert case.truth['excitation'] == 'calibration'
    comparable = case.truth['comparable'][name]
    assert set(comparable) == COMPARABLE.get(name, set())
    assert all(math.isfinite(value) for value in comparable.values())
    for streams in case.recordings.values():
        for stream in streams:
            for values in (stream.position, stream.velocity, stream.effort):
                assert np.isfinite(values).all()
    shows = excess(case)
    quiet = {topic: values.max() < 1.15 for topic, values in shows.items()}
    if name == 'recording_gap':
        assert sorted(stream.stamps.size for stream in case.recordings['']) != [360] + 4 * [9000]
        return
    stage = concealed['stage']
    if stage == 'actuator' and name not in ('gear_backlash', 'cogging'):
        assert not quiet['motor/measured_js']
    elif stage != 'recording':
        assert quiet['motor/measured_js']
    if name.startswith('tracker'):
        assert quiet['wires/measured_js']
    if name.startswith('load_cell'):
        assert quiet['slave/measured_js']
        assert (shows['wires/measured_js'] > 1.15).sum() == 1
    assert not all(quiet.values())


@pytest.mark.parametrize('name', sorted(set(EFFECTS) - {'recording_gap'}))
def test_a_tenth_of_an_effect_is_less_of_it(name):
    # Same effect, another seed per stratum: compare what a tenth leaves with a generous margin.
    usual = draw_case(7, 'single', 'calibration', effects=(name,), joint=_seen(name))
    weak = draw_case(7, 'weak', 'calibration', effects=(name,), joint=_seen(name))
    total = [sum(np.sum(v**2 - 1.0) for v in excess(case).values()) for case in (usual, weak)]
    assert total[1] < 0.5 * total[0]


def _seen(name):
    return 'bend_y' if name == 'cross_coupling' else 'bend_x'


@pytest.mark.parametrize('name', sorted(OUTSIDE))
def test_physics_outside_the_catalogue_has_no_name_in_the_truth(name):
    case = draw_case(3, 'outside', 'calibration', effects=(name,), joint='bend_x')
    assert name not in EFFECTS
    assert case.truth['effects'] == []
    assert case.truth['verdict'] == 'unknown_physics'
    assert [c['id'] for c in case.truth['concealed']] == [name]
    if name not in ('other_joint_wrap',):  # the other joint rests
        assert max(v.max() for v in excess(case).values()) > 1.5


def test_null_cases_are_the_nominal_plant_or_its_parameters_off():
    cases = [draw_case(seed, 'null', 'calibration') for seed in range(5)]
    verdicts = {case.truth['verdict'] for case in cases}
    assert verdicts == {'consistent', None}
    for case in cases:
        assert case.truth['effects'] == []
        pretension = case.truth['rig']['bend_x']['pretension']
        assert (pretension == 5.0) == (case.truth['verdict'] == 'consistent')
        assert abs(pretension - 5.0) <= 0.75
        for topic, values in excess(case).items():
            if topic != 'motor/measured_js':
                np.testing.assert_allclose(values, 1.0, atol=0.13)


def test_a_pair_conceals_two():
    case = draw_case(11, 'pair', 'calibration')
    assert len(set(case.truth['effects'])) == 2
    assert set(case.truth['comparable']) == set(case.truth['effects'])


def test_a_foreign_rig_has_a_long_chain_and_a_baseline_without_the_effect():
    case = draw_case(2, 'foreign', 'calibration', effects=('load_cell_gain',))
    assert set(case.recordings) == {'baseline', '', 'second'}
    assert all(case.truth['rig'][joint]['segments'] >= 20 for joint in ('bend_x', 'bend_y'))
    # The lumped plant does not match it, effect or not.
    assert excess(case)['wires/measured_js'][:2].min() > 3.0
    now = by_topic(case.recordings[''])['wires/measured_js'].effort
    before = by_topic(case.recordings['baseline'])['wires/measured_js'].effort
    changed = np.sqrt(np.mean((now - before) ** 2, axis=0)) > 0.06
    assert changed.sum() == 1


def test_the_same_arguments_give_the_same_case_and_others_another():
    first, again, other = (draw_case(s, 'single', 'calibration') for s in (4, 4, 5))
    assert first.truth == again.truth
    assert first.name == again.name != other.name
    for a, b in zip(first.recordings['second'], again.recordings['second'], strict=True):
        np.testing.assert_array_equal(a.log_times, b.log_times)
        np.testing.assert_array_equal(a.effort, b.effort)
    assert first.truth['rig'] != other.truth['rig']


def test_commissioning_moves_the_second_joint_in_the_last_forty_percent():
    case = draw_case(1, 'null')
    command = by_topic(case.recordings[''])['slave/servo_jp'].position
    assert command.shape == (40000, 2)
    assert not command[:24000, 1].any()
    assert np.abs(command[:, 1]).max() == pytest.approx(np.radians(45.0), abs=1e-3)
    np.testing.assert_allclose(
        command[:9000, 0], 0.5 * np.pi * np.sin(np.arange(9000) * 1e-3), atol=1e-5
    )
    assert np.abs(np.diff(command, axis=0)).max() < 0.02


def test_a_written_case_reads_back_and_keeps_its_truth_apart(tmp_path):
    case = draw_case(9, 'single', 'calibration', effects=('gravity',))
    path = write_case(case, tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        [
            f'{case.name}.mcap',
            f'{case.name}.second.mcap',
            f'{case.name}.truth.json',
            'plant.yaml',
        ]
    )
    assert 'gravity' not in case.name
    assert b'gravity' not in path.read_bytes()
    assert json.loads((tmp_path / f'{case.name}.truth.json').read_text()) == case.truth
    bag = open_bag(path)
    for stream in case.recordings['']:
        series = bag.joint_state(stream.topic, order='recorded')
        np.testing.assert_array_equal(series.stamp_ns, stream.stamps)
        assert series.names == stream.names
        if stream.effort.size:
            np.testing.assert_array_equal(series.effort, stream.effort)
    with pytest.raises(FileExistsError, match='exists already'):
        write_case(case, tmp_path)


def test_wrong_requests_name_what_is_known():
    with pytest.raises(ValueError, match=r"unknown stratum 'double'.*single"):
        draw_case(0, 'double')
    with pytest.raises(ValueError, match="unknown motion 'jog'"):
        draw_case(0, 'single', 'jog')
    with pytest.raises(ValueError, match="unknown effect 'moment_bump'"):
        draw_case(0, 'single', effects=('moment_bump',))
    with pytest.raises(ValueError, match="unknown joint 'bend_z'"):
        draw_case(0, 'single', joint='bend_z')
    with pytest.raises(ValueError, match='cannot be concealed in a foreign rig'):
        draw_case(0, 'foreign', effects=('joint_backlash',))
    with pytest.raises(ValueError, match='joint_backlash cannot be concealed together'):
        draw_case(0, 'pair', effects=('distributed_friction', 'joint_backlash'))
    with pytest.raises(ValueError, match='at least one'):
        plan_cases(0, 1)


def test_a_plan_covers_strata_and_effects_evenly():
    plan = plan_cases(200, 3)
    assert len(plan) == 200
    assert len({request.seed for request in plan}) == 200
    assert {request.stratum for request in plan} == set(STRATA)
    assert {request.motion for request in plan} == set(MOTIONS)
    singles = [r.effects[0] for r in plan if (r.stratum, r.motion) == ('single', 'commissioning')]
    counts = [singles.count(name) for name in EFFECTS]
    assert max(counts) - min(counts) <= 1
    assert plan == plan_cases(200, 3)
    assert {r.seed for r in plan}.isdisjoint(r.seed for r in plan_cases(200, 4))


def test_the_program_writes_cases_and_says_what_is_wrong(tmp_path, capsys):
    arguments = ['--out', str(tmp_path), '--stratum', 'null', '--motion', 'calibration']
    assert main([*arguments, '--seed', '6']) == 0
    assert capsys.readouterr().out.strip().endswith('.mcap')
    assert main([*arguments, '--seed', '6']) == 2
    assert 'exists already' in capsys.readouterr().err
