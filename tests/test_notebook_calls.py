"""`endoscope_explain.read`, `simulate` and `explain`: as the commands, with results in memory."""

import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure
from short_bags import PLANT, one_joint, write_short_bag

import endoscope_explain
from endoscope_bringup.cli import main
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import PlantDescription, load_plant, save_plant

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


def test_what_is_shown_needs_no_other_file(bag):
    html = endoscope_explain.read(bag)._repr_html_()
    assert 'wires/measured_js:wire_x_pos' in html
    assert html.count('src="data:image/png;base64,') == html.count('src=') == 1


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
    figure = of_joint.plot([name], beside=of_shaft)
    assert isinstance(figure, Figure)
    [axis] = figure.axes
    assert len(axis.lines) == 2
    assert axis.lines[0].get_ydata() == pytest.approx(np.degrees(of_joint[name].values))


@pytest.mark.parametrize(
    ('commands', 'message'),
    [
        ({'bend_x': TIME}, 'time: give two or more times'),
        ({'time': TIME[::-1], 'bend_x': TIME}, 'time: give two or more times'),
        ({'time': TIME}, 'command joints'),
        ({'time': TIME, 'bend_x': TIME, 'motor_y': TIME}, 'command joints'),
        ({'time': TIME, 'bend_x': TIME[1:]}, 'bend_x: give 1000 finite angles'),
        ({'time': TIME, 'bend_x': TIME * np.nan}, 'bend_x: give 1000 finite angles'),
        ({'time': TIME, 'bend_z': TIME}, 'commands bend_z'),
    ],
)
def test_arrays_that_are_no_commands_are_refused(commands, message):
    with pytest.raises(EndoscopeError, match=message):
        endoscope_explain.simulate(PlantDescription(), commands)


@pytest.mark.timeout(900)
def test_an_explanation_is_looked_at_saved_and_gone_on_with(bag, tmp_path):
    told = []
    found = endoscope_explain.explain(bag, one_joint(), quick=True, progress=told.append)
    assert found.verdict == 'consistent'
    assert found.effects == ()
    assert 'refitting the nominal plant' in told
    assert 'rmse / noise' in repr(found)
    assert 'slave:bend_x' in repr(found)
    html = found._repr_html_()
    assert html.count('src="data:image/png;base64,') == html.count('src=') == 1
    assert [axis.get_ylabel() for axis in found.plot().axes] == ['bend_x [deg]', 'error [deg]']
    folder = found.save(tmp_path / 'report')
    assert {path.name for path in folder.iterdir()} == {'report.json', 'report.html', 'plant.yaml'}
    assert load_plant(folder / 'plant.yaml') == found.plant
    assert found.report['verdict'] == 'consistent'
    again = endoscope_explain.simulate(found.plant, bag)
    assert len(again['slave/measured_js:bend_x']) == 80
