"""`endoscope_explain.read`, `simulate` and `explain`: as the commands, with results in memory."""

import inspect
import pydoc
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from short_bags import PLANT, one_joint, write_short_bag

import endoscope_explain
from endoscope_bringup.cli import main
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import EffectSpec, PlantDescription, load_plant, save_plant
from endoscope_core.rig import shipped_rig
from endoscope_explain.case import Sources
from endoscope_explain.pipeline import read_inputs
from endoscope_explain.report.html_page import html_page

TIME = np.arange(0.0, 1.0, 1e-3)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return write_short_bag(tmp_path_factory.mktemp('bags') / 'short', duration=2.0)


def test_the_import_is_quick_and_knows_no_other_name():
    program = (
        'import sys, endoscope_explain\n'
        "print(*sorted(set(sys.modules) & {'numba', 'scipy', 'matplotlib', 'numpy', 'rosbags'}))\n"
        "print(hasattr(endoscope_explain, 'explian'), callable(endoscope_explain.read))\n"
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ['', 'False True']


def test_help_shows_what_can_be_called_and_what_it_returns():
    calls = ['explain', 'from_arrays', 'read', 'simulate']
    assert dir(endoscope_explain) == sorted(['EndoscopeError', *calls])
    shown = pydoc.plain(pydoc.render_doc(endoscope_explain))
    assert '__getattr__' not in shown
    for name in calls:
        assert f'    {name}(' in shown
        assert 'Returns\n-------\n' in inspect.getdoc(getattr(endoscope_explain, name))
    assert endoscope_explain.EndoscopeError is EndoscopeError


def test_a_signal_is_an_array(bag):
    angle = endoscope_explain.read(bag)['slave/measured_js:bend_x']
    assert np.array_equal(np.asarray(angle), angle.values)
    assert np.asarray(angle, dtype=np.float32).dtype == np.float32
    assert np.degrees(angle).shape == (80,)
    copied = np.array(angle)
    copied[0] = 7.0
    assert angle.values[0] != 7.0


def test_signals_become_a_frame_of_pandas(bag):
    signals = endoscope_explain.read(bag)
    frame = signals.to_frame()
    assert list(frame) == list(signals)
    assert frame.index.name == 'time'
    for name, signal in signals.items():
        column = frame[name].dropna()
        assert np.array_equal(column.index, signal.time)
        assert np.array_equal(column, signal.values)


def test_without_pandas_a_table_is_refused_in_one_line(bag):
    program = (
        'import sys; sys.modules["pandas"] = None\n'
        'import endoscope_explain\n'
        f'signals = endoscope_explain.read({str(bag)!r})\n'
        'try:\n    signals.to_frame()\n'
        'except endoscope_explain.EndoscopeError as error:\n    print(error)'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True
    )
    assert done.stdout == 'to_frame needs pandas: `make -C ros_ws pandas` installs it\n'


def test_ones_own_arrays_are_a_recording(bag, tmp_path):
    measured = endoscope_explain.read(bag)
    given = {name: (signal.time, signal.values) for name, signal in measured.items()}
    given['slave/measured_js:bend_x'] = measured['slave/measured_js:bend_x']
    for made in (
        endoscope_explain.from_arrays(given),
        endoscope_explain.from_arrays(given, out=tmp_path / 'kept'),
        endoscope_explain.read(tmp_path / 'kept'),
    ):
        assert set(made) == set(measured)
        for name, signal in measured.items():
            assert np.array_equal(made[name].values, signal.values)
            assert made[name].time == pytest.approx(signal.time, abs=1e-9)
    with pytest.raises(EndoscopeError, match='exists'):
        endoscope_explain.from_arrays(given, out=tmp_path / 'kept')
    again, before = (endoscope_explain.simulate(PLANT, one) for one in (made, bag))
    name = 'wires/measured_js:wire_x_pos'
    assert again[name].values == pytest.approx(before[name].values)


WIRE, OTHER = 'wires/measured_js:wire_x_pos', 'wires/measured_js:wire_x_neg'


@pytest.mark.parametrize(
    ('signals', 'message'),
    [
        ({}, 'no signals: give some of motor/servo_jp:motor_x'),
        ({'wires/measured_js:wire_x_po': (TIME, TIME)}, f'did you mean {WIRE}'),
        ({'motor/servo_jq:motor_x': (TIME, TIME)}, 'did you mean motor/servo_jp:motor_x'),
        ({WIRE: (TIME, TIME), OTHER: (TIME + 1.0, TIME)}, f'{OTHER}: give it the times of {WIRE}'),
        ({WIRE: (TIME[::-1], TIME)}, 'increase'),
        ({WIRE: (1e12 * TIME, TIME)}, 'times are in s'),
        ({WIRE: (TIME, TIME[1:])}, 'give 1000 values, one for each time'),
        ({WIRE: TIME}, 'an array of times and one of values'),
        ({WIRE: (TIME, np.where(TIME < 0.5, 1.0, np.nan))}, '500 of 1000 values are not finite'),
    ],
)
def test_arrays_that_are_no_recording_are_refused(signals, message):
    with pytest.raises(EndoscopeError, match=message):
        endoscope_explain.from_arrays(signals)


@pytest.mark.parametrize(
    ('effect', 'message'),
    [
        (EffectSpec('gravty', 'bend_x'), 'the plant: unknown effect gravty: did you mean gravity'),
        (EffectSpec('gravity', 'bend_z'), 'is on joint bend_z: did you mean bend_x'),
        (EffectSpec('gravity', 'bend_x', {'moment': 1.0}), 'did you mean moment_nm'),
        (EffectSpec('gravity', 'bend_x', {'moment_nm': np.nan}), 'moment_nm is nan'),
    ],
)
def test_a_wrong_effect_is_found_before_a_recording_is_read(effect, message):
    for call in (
        endoscope_explain.explain,
        lambda bag, plant: endoscope_explain.simulate(plant, bag),
    ):
        with pytest.raises(EndoscopeError, match=message):
            call('there is no such recording', one_joint(effect))


@pytest.mark.parametrize(
    ('given', 'options', 'message'),
    [
        ([], {}, '0 recordings'),
        (['a', 'b'], {'validate': ['c']}, '2 recordings with 1 in validate'),
        ('a', {'without': ['motor/measured_j']}, 'did you mean motor/measured_js'),
        ('a', {'effects': 0}, 'effects is 0'),
        ('a', {'band': -1.0}, 'band is -1.0'),
    ],
)
def test_options_that_cannot_be_used_are_refused_early(given, options, message):
    with pytest.raises(EndoscopeError, match=message):
        endoscope_explain.explain(given, PLANT, **options)


@pytest.mark.parametrize(
    ('call', 'message'),
    [
        (lambda bag: endoscope_explain.read(None), 'bag is of type NoneType: give str or Path'),
        (lambda bag: endoscope_explain.explain(bag, {}), 'plant is of type dict: give str or Path'),
        (lambda bag: endoscope_explain.explain([bag, 5], PLANT), 'bag is of type list: give str'),
        (
            lambda bag: endoscope_explain.explain(bag, PLANT, without='motor/measured_js'),
            'without is of type str: give Collection of str',
        ),
        (lambda bag: endoscope_explain.explain(bag, PLANT, band='3'), 'type str: give float'),
        (lambda bag: endoscope_explain.explain(bag, PLANT, effects=1.5), 'type float: give int'),
        (lambda bag: endoscope_explain.explain(bag, PLANT, progress=5), 'give Callable'),
        (lambda bag: endoscope_explain.simulate(PLANT, bag, rig=5), 'give str or Path or Rig'),
        (lambda bag: endoscope_explain.simulate(PLANT, bag, noise=-1), 'noise is -1: give a seed'),
        (lambda bag: endoscope_explain.from_arrays([TIME]), 'type list: give Mapping of str'),
        (lambda bag: endoscope_explain.read(bag)[5], 'short: no signal 5: valid are'),
    ],
)
def test_a_wrong_type_is_named_with_the_right_ones(bag, call, message):
    with pytest.raises(EndoscopeError, match=message):
        call(bag)


def test_a_recording_of_arrays_that_lacks_a_topic_is_named_without_the_folder_it_lies_in():
    lacking = endoscope_explain.from_arrays({'slave/measured_js:bend_x': (TIME, TIME)})
    with pytest.raises(EndoscopeError, match=r'^arrays\.mcap: lacks topic motor/'):
        endoscope_explain.explain(lacking, PLANT)


def test_signals_are_arrays_in_si_by_name(bag):
    signals = endoscope_explain.read(bag)
    assert set(signals) == {
        'motor/servo_jp:motor_x',
        'motor/measured_js:motor_x.position',
        'motor/measured_js:motor_x.velocity',
        'motor/measured_js:motor_x.effort',
        'wires/measured_js:wire_x_pos',
        'wires/measured_js:wire_x_neg',
        'slave/measured_js:bend_x',
    }
    wire, angle = signals['wires/measured_js:wire_x_pos'], signals['slave/measured_js:bend_x']
    assert (wire.unit, angle.unit, len(wire), len(angle)) == ('N', 'rad', 2000, 80)
    assert wire.values[0] == pytest.approx(5.0, abs=0.2)
    assert angle.time[1] - angle.time[0] == pytest.approx(0.025)
    assert 'wires/measured_js:wire_x_pos' in repr(signals)
    with pytest.raises(EndoscopeError, match='did you mean slave/measured_js:bend_x'):
        signals['slave/measured_js:bend_z']


def test_it_simulates_what_the_command_does(bag, tmp_path):
    save_plant(PLANT, tmp_path / 'plant.yaml')
    plant, out = str(tmp_path / 'plant.yaml'), str(tmp_path / 'out')
    argv = ['simulate', '--plant', plant, '--commands', str(bag), '--out', out, '--noise', '3']
    assert main(argv) == 0
    by_command = endoscope_explain.read(out)
    for plant_given, commands in ((plant, bag), (PLANT, endoscope_explain.read(bag))):
        simulated = endoscope_explain.simulate(plant_given, commands, noise=3)
        assert set(simulated) == set(by_command)
        for name, signal in simulated.items():
            assert np.array_equal(signal.values, by_command[name].values)
            assert np.array_equal(signal.time, by_command[name].time)


def test_arrays_command_joints_or_shafts(tmp_path):
    angle = 0.5 * np.sin(3.0 * TIME)
    of_joint = endoscope_explain.simulate(PLANT, {'time': TIME, 'bend_x': angle})
    # The shaft turns half as far as the joint is to bend.
    of_shaft = endoscope_explain.simulate(
        PLANT, {'time': TIME, 'motor_x': 0.5 * angle}, out=tmp_path / 'kept'
    )
    name = 'slave/measured_js:bend_x'
    assert of_joint[name].values == pytest.approx(of_shaft[name].values, abs=1e-12)
    # Backlash takes most of it.
    assert 0.01 < np.ptp(of_joint[name].values) < 0.1
    assert endoscope_explain.read(tmp_path / 'kept')[name].values.tolist() == (
        of_shaft[name].values.tolist()
    )


@pytest.mark.nightly
@pytest.mark.engine
def test_desired_angles_are_times_the_gear_of_the_rig_that_was_recorded(tmp_path):
    rig = replace(shipped_rig(), joints=replace(shipped_rig().joints, gear=0.6, drive=2.5))
    time = np.arange(0.0, 6.0, 1e-3)
    commands = {'time': time, 'bend_x': 1.2 * np.sin(2.2 * time)}
    bag = endoscope_explain.simulate(PLANT, commands, noise=5, out=tmp_path / 'bag', rig=rig)
    told = []
    found, mistaken = (
        endoscope_explain.explain(bag, one_joint(), quick=True, rig=each, progress=told.append)
        for each in (None, shipped_rig())
    )
    assert found.verdict == 'consistent'
    assert any('times the gear, 0.6,' in each for each in told)
    assert mistaken.verdict != 'consistent'


@pytest.mark.parametrize(
    ('commands', 'message'),
    [
        ({'bend_x': TIME}, 'bend_x: give time, and angles of joints'),
        ({'time': TIME[::-1], 'bend_x': TIME}, 'bend_x: give two or more times'),
        ({'time': TIME}, 'time: give time, and angles of joints'),
        ({'time': TIME, 'bend_x': TIME, 'motor_y': TIME}, 'angles of joints'),
        ({'time': TIME, 'bend_x': TIME[1:]}, 'bend_x: give 1000 values'),
        ({'time': TIME, 'bend_x': TIME * np.nan}, 'bend_x: 1000 of 1000 values are not finite'),
        ({'time': TIME, 'bend_z': TIME}, 'bend_z is not a signal: did you mean'),
    ],
)
def test_arrays_that_are_no_commands_are_refused(commands, message):
    with pytest.raises(EndoscopeError, match=message):
        endoscope_explain.simulate(PlantDescription(), commands)


def test_an_explanation_is_looked_at_saved_and_gone_on_with(corpus, tmp_path):
    told = []
    bag = corpus.bag('sound')
    found = endoscope_explain.explain(bag, one_joint(), quick=True, progress=told.append)
    assert found.verdict == 'consistent'
    assert found.effects == ()
    assert 'refitting the nominal plant' in told
    assert 'rmse / noise' in repr(found)
    assert 'slave:bend_x' in repr(found)
    folder = found.save(tmp_path / 'report')
    assert {path.name for path in folder.iterdir()} == {'report.json', 'report.html', 'plant.yaml'}
    assert load_plant(folder / 'plant.yaml') == found.plant
    assert found.report['verdict'] == 'consistent'
    again = endoscope_explain.simulate(found.plant, bag)
    assert len(again['slave/measured_js:bend_x']) == 160


def test_several_recordings_are_explained_in_one_call(corpus, tmp_path):
    other = tmp_path / 'other.mcap'
    other.write_bytes(corpus.bag('sound').read_bytes())
    both = [corpus.bag('sound'), endoscope_explain.read(other)]
    found = endoscope_explain.explain(both, one_joint(), quick=True)
    assert [one.recording.name for one in found] == ['sound', 'other']
    assert [one.verdict for one in found] == ['consistent', 'consistent']
    alone = endoscope_explain.explain(both[0], one_joint(), quick=True)
    assert found[0].report | {'runtime_s': 0} == alone.report | {'runtime_s': 0}
    with pytest.raises(EndoscopeError, match='are mutually exclusive'):
        endoscope_explain.explain(both, one_joint(), same_physics=True, baseline=other)


def test_another_recording_in_degrees_is_used_as_corrected_and_that_is_said(corpus):
    bag = corpus.bag('sound')
    signals = dict(endoscope_explain.read(bag))
    angle = signals['slave/measured_js:bend_x']
    signals[angle.name] = (angle.time, np.degrees(angle.values))
    mistaken = endoscope_explain.from_arrays(signals)
    told = []
    found = endoscope_explain.explain(
        bag, one_joint(), quick=True, progress=told.append, validate=mistaken
    )
    said = f'{angle.name} is 57.3 times what the plant can give: in deg'
    for text in (repr(found), html_page(found), '\n'.join(told)):
        assert said in text
    assert found.verdict == 'consistent'
    assert found.validation['refitted'][angle.name].ratio < 1.2
    inputs = read_inputs(Sources(bag, one_joint(), baseline=mistaken.path))
    assert inputs.baseline.bending.values[:, 0] == pytest.approx(angle.values)
    assert said in inputs.mistakes_of_others[0]
