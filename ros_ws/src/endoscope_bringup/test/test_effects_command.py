"""`endoscope effects`."""

import json

from endoscope_bringup.cli import main
from endoscope_core.physics import PlantDescription, load_plant
from endoscope_core.physics.description import NUMBERS
from endoscope_core.physics.effects import CATALOGUE, NOMINAL_PHYSICS
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.plant_file import plant_from_mapping


def test_lists_every_effect(capsys):
    assert main(['effects']) == 0
    effects, heading, places = capsys.readouterr().out.partition('\nPlaces for an unknown_term')
    effects, _, nominal = effects.partition('\nOf the nominal plant')
    assert [line.split()[0] for line in effects.splitlines()] == list(CATALOGUE)
    assert [line.split()[0] for line in nominal.splitlines()[1:]] == list(NOMINAL_PHYSICS)
    assert heading
    assert [line.split()[0] for line in places.splitlines()[1:]] == list(FUNCTIONS)


def test_shows_equation_source_and_parameters(capsys):
    assert main(['effects', 'joint_stop', 'load_cell_gain']) == 0
    output = ' '.join(capsys.readouterr().out.split())
    definition = CATALOGUE['joint_stop']
    assert definition.equation in output
    assert definition.source in output
    assert '0.05 to 2.5 rad, typical 0.25, off at 2.5' in output
    assert (
        'wire 0: the cell of the positive wire, 1: the cell of the negative wire, typical' in output
    )


def test_an_unknown_effect_is_one_line_and_exit_2(capsys):
    assert main(['effects', 'joint_stp']) == 2
    err = capsys.readouterr().err
    assert 'joint_stop' in err
    assert err.count('\n') == 1


def test_a_complete_plant_is_printed_that_is_the_nominal_one(tmp_path, capsys):
    assert main(['effects', '--plant']) == 0
    text = capsys.readouterr().out
    (tmp_path / 'plant.yaml').write_text(text)
    assert load_plant(tmp_path / 'plant.yaml') == PlantDescription()
    for key, known in NUMBERS.items():
        assert f'{key}: ' in text
        assert known.meaning in text


def test_the_catalogue_as_json(capsys):
    assert main(['effects', '--json']) == 0
    effects = json.loads(capsys.readouterr().out)
    assert [effect['id'] for effect in effects] == [*CATALOGUE, *NOMINAL_PHYSICS]
    gravity = next(effect for effect in effects if effect['id'] == 'gravity')
    [moment] = [p for p in gravity['parameters'] if p['name'] == 'moment_nm']
    assert (moment['unit'], moment['high']) == ('N m', 0.1)
    assert main(['effects', '--plant', '--json']) == 0
    assert plant_from_mapping(json.loads(capsys.readouterr().out)) == PlantDescription()


def test_shows_a_place(capsys):
    assert main(['effects', 'load_of_speed']) == 0
    output = ' '.join(capsys.readouterr().out.split())
    assert "f(w), odd, w = the joint's angular speed" in output
    assert 'w -10 to 10 rad/s where no range is given' in output
