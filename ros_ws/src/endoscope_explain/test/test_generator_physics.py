"""The concealed rig against the nominal equations written down once more, and its laws."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest

import endoscope_core
from endoscope_core.compiled_cache import cache_folder, source_hash
from endoscope_explain import generator
from endoscope_explain.generator import compiled_physics
from endoscope_explain.generator.concealed_physics import TICK, move
from endoscope_explain.generator.motions import GEAR, joint_command
from endoscope_explain.generator.rig import NOMINAL, nominal_rig


def nominal_plant_by_euler(shaft, step=2e-5):
    """Tensions, bending and shaft angle of one nominal joint; explicit Euler, row k at tick k."""
    p = NOMINAL
    r, k, xs, qs = (
        p['joint_radius'],
        p['wire_stiffness'],
        p['presliding_distance'],
        p['joint_presliding'],
    )
    half_phi, wm = 0.5 * p['capstan_exponent'], p['motor_bandwidth']
    gear = r / p['pulley_radius']
    m = md = q = za = zb = zj = 0.0
    rows = []
    for command in shaft:
        ta = max(0.0, p['pretension'] + k * r * (m - q))
        tb = max(0.0, p['pretension'] - k * r * (m - q))
        rows.append((ta * math.exp(half_phi * za), tb * math.exp(half_phi * zb), q, gear * m))
        for _ in range(round(TICK / step)):
            ta = max(0.0, p['pretension'] + k * r * (m - q))
            tb = max(0.0, p['pretension'] - k * r * (m - q))
            pull = r * (ta * math.exp(-half_phi * za) - tb * math.exp(-half_phi * zb))
            qd = (pull - p['joint_stiffness'] * q - p['joint_friction'] * zj) / p['joint_damping']
            v = 0.5 * r * (md + qd)
            mdd = wm * wm * (command / gear - m) - 2.0 * p['motor_damping_ratio'] * wm * md
            za += step * (v - abs(v) * za) / xs
            zb += step * (-v - abs(v) * zb) / xs
            zj += step * (qd - abs(qd) * zj) / qs
            m, md, q = m + step * md, md + step * mdd, q + step * qd
    return np.array(rows)


@pytest.fixture(scope='module')
def quick_moves():
    """Shaft commands of two seconds with steps, reversals and both joints moving."""
    t = np.arange(2000) * TICK
    x = np.where(t < 1.0, 1.4 * np.sin(2.0 * np.pi * t), np.where(t < 1.5, 0.8, -0.4))
    return GEAR * np.column_stack([x, 0.6 * np.sin(5.0 * t)])


def test_nothing_concealed_is_the_nominal_plant_within_a_tenth_of_the_noise(quick_moves):
    motion = move(nominal_rig(), quick_moves)
    for joint in range(2):
        reference = nominal_plant_by_euler(quick_moves[:, joint])
        tension = motion.tension[:, 2 * joint : 2 * joint + 2]
        assert np.sqrt(np.mean((tension - reference[:, :2]) ** 2)) < 0.002
        assert np.degrees(np.abs(motion.bending[:, joint] - reference[:, 2]).max()) < 0.025
        np.testing.assert_allclose(motion.shaft_angle[:, joint], reference[:, 3], atol=3e-4)
        torque = NOMINAL['pulley_radius'] * (tension[:, 0] - tension[:, 1])
        np.testing.assert_allclose(motion.torque[:, joint], torque, atol=1e-12)


def test_a_chain_with_all_friction_lumped_is_the_lumped_rig(quick_moves):
    lumped = move(nominal_rig(), quick_moves)
    rig = nominal_rig()
    rig['segments'], rig['lumped_share'] = 6.0, 1.0
    chain = move(rig, quick_moves)
    assert np.sqrt(np.mean((chain.tension - lumped.tension) ** 2)) < 0.03
    assert np.degrees(np.sqrt(np.mean((chain.bending - lumped.bending) ** 2))) < 0.1


def test_a_chain_settles_as_its_segments_get_shorter(quick_moves):
    def tension(segments):
        rig = nominal_rig()
        rig['segments'] = segments
        return move(rig, quick_moves).tension

    finest = tension(40.0)
    errors = [np.sqrt(np.mean((tension(n) - finest) ** 2)) for n in (3.0, 8.0, 20.0)]
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]
    lumped = move(nominal_rig(), quick_moves).tension
    assert np.sqrt(np.mean((lumped - finest) ** 2)) > 10.0 * errors[2]


def test_a_chain_moves_its_far_end_after_its_near_end():
    shaft = np.zeros((400, 2))
    shaft[:, 0] = np.linspace(0.0, 0.2, 400)
    rig = nominal_rig()
    began = []
    for segments in (1.0, 20.0):
        rig['segments'] = segments
        began.append(int(np.argmax(move(rig, shaft).bending[:, 0] > 1e-4)))
    assert began[1] > began[0] + 5


def test_a_late_command_moves_the_shaft_late(quick_moves):
    rig = nominal_rig()
    prompt = move(rig, quick_moves)
    rig['transport_delay'][0] = 0.02
    late = move(rig, quick_moves)
    np.testing.assert_allclose(late.shaft_angle[20:, 0], prompt.shaft_angle[:-20, 0], atol=1e-9)
    np.testing.assert_array_equal(late.shaft_angle[:, 1], prompt.shaft_angle[:, 1])


@pytest.mark.parametrize('field', ['command_slew', 'speed_limit'])
def test_a_speed_limit_holds(quick_moves, field):
    rig = nominal_rig()
    rig[field] = 1.0
    motion = move(rig, quick_moves)
    # A slewed command drives a servo that overshoots a little.
    most = 1.0 + 1e-9 if field == 'speed_limit' else 1.1
    assert np.abs(motion.shaft_speed).max() <= most
    assert np.abs(move(nominal_rig(), quick_moves).shaft_speed).max() > 3.0


def test_a_torque_limit_holds():
    shaft = GEAR * joint_command('calibration', np.random.default_rng(0))
    rig = nominal_rig()
    free = np.abs(move(rig, shaft).torque[:, 0]).max()
    rig['torque_limit'] = 0.8 * free
    assert np.abs(move(rig, shaft).torque[:, 0]).max() < 0.82 * free


def test_a_stop_stops_and_its_stiffness_shows():
    shaft = GEAR * joint_command('calibration', np.random.default_rng(0))
    rig = nominal_rig()
    rig['stop_angle'], rig['stop_stiffness'], rig['stop_loss'] = 0.6, 0.4, 0.05
    stopped = move(rig, shaft)
    assert 0.6 < np.abs(stopped.bending[:, 0]).max() < 0.66


@pytest.mark.parametrize('field', ['flank_gap', 'output_gap'])
def test_joint_play_widens_the_loop_of_the_tip(field):
    shaft = GEAR * joint_command('calibration', np.random.default_rng(0))

    def width(rig):
        motion = move(rig, shaft)
        angle = motion.bending[:, 0]
        crossings = np.flatnonzero(np.diff(np.sign(angle[2000:]))) + 2000
        return abs(np.diff(motion.shaft_angle[crossings[:2], 0])[0]) / GEAR

    rig = nominal_rig()
    tight = width(rig)
    rig[field] = 0.1
    assert width(rig) - tight == pytest.approx(0.1, abs=0.05)


def test_shares_nothing_with_the_plant_that_fits():
    for path in Path(generator.__file__).parent.glob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom):
                names = [node.module or '']
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                continue
            for name in names:
                own = name.startswith('endoscope_explain.generator')
                foreign = not name.startswith('endoscope_') or name.startswith('endoscope_bags')
                assert own or foreign or name == 'endoscope_core.compiled_cache', (path, name)


def test_compiled_functions_are_kept_by_the_sources_of_plant_and_generator():
    plant = Path(endoscope_core.__file__).parent
    generator = Path(compiled_physics.__file__).parent
    name = cache_folder(*compiled_physics.KEPT_BY).name
    assert source_hash(plant) in name
    assert source_hash(generator) in name
