"""plant.yaml: what is written is read back, and what is wrong is named."""

from dataclasses import asdict, replace

import pytest

from endoscope_core.errors import FileError
from endoscope_core.physics import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    SensorParameters,
    TermSpec,
    load_plant,
    save_plant,
)
from endoscope_core.physics.description import NUMBERS
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions.places import NODES


def written(tmp_path, text):
    path = tmp_path / 'plant.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def test_a_plant_with_every_effect_survives_the_round_trip(tmp_path):
    plant = PlantDescription(
        joints={'bend_x': JointParameters(capstan_exponent=1.3), 'bend_y': JointParameters()},
        sensors=SensorParameters(tracker_rate=60.0),
        effects=tuple(
            EffectSpec(definition.id, 'bend_y', {p.name: p.typical for p in definition.parameters})
            for definition in CATALOGUE.values()
        ),
    )
    save_plant(plant, tmp_path / 'plant.yaml')
    assert load_plant(tmp_path / 'plant.yaml') == plant
    assert [path.name for path in tmp_path.iterdir()] == ['plant.yaml']


@pytest.mark.parametrize(
    'text', ['{}', 'joints: {bend_x: {}, bend_y: {}}\neffects: []\n', 'joints:']
)
def test_what_is_missing_is_nominal(tmp_path, text):
    plant = load_plant(written(tmp_path, text))
    assert plant.sensors == SensorParameters()
    assert all(joint == JointParameters() for joint in plant.joints.values())
    assert plant.effects == ()


def test_joints_come_in_one_order_and_one_may_be_alone(tmp_path):
    both = load_plant(written(tmp_path, 'joints: {bend_y: {pretension: 6}, bend_x: }'))
    assert both.joint_names() == ('bend_x', 'bend_y')
    assert both.joints['bend_y'] == replace(JointParameters(), pretension=6.0)
    assert load_plant(written(tmp_path, 'joints: {bend_y: }')).joint_names() == ('bend_y',)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('joints: {bend_z: {}}', 'joints: unknown key bend_z: did you mean bend_'),
        ('', 'is empty: name joints at least, such as'),
        ('joints: {}', 'joints is empty'),
        ('joints: {bend_x: {capstan_exponant: 1}}', 'did you mean capstan_exponent'),
        ('sensors: {tracker_rate: 0}', 'tracker_rate is 0: give a number from 0.1 to 100000 Hz'),
        ('effects: [{id: gravty, joint: bend_x}]', 'unknown effect gravty: did you mean gravity'),
        ('effects: [{id: gravity, joint: bend_x, parameters: {moment: 1}}]', 'mean moment_nm'),
        ('effects: [{id: gravity, joint: bend_x, parameters: {moment_nm: 9}}]', 'moment_nm is 9'),
        ('joints: {bend_x: }\neffects: [{id: gravity, joint: bend_y}]', 'joint bend_y'),
        ('effects: [{id: gravity, joint: bend_x, parameters: {5: 1}}]', 'key 5 is no name'),
    ],
)
def test_what_is_wrong_is_named_in_one_line(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(FileError, match=message) as caught:
        load_plant(path)
    assert str(path) in str(caught.value)
    assert '\n' not in str(caught.value)


def test_every_parameter_has_a_reach_that_holds_its_nominal_value():
    nominal = asdict(JointParameters()) | asdict(SensorParameters())
    nominal['friction_profile'] = 0.0
    for key, value in nominal.items():
        assert NUMBERS[key].low <= value <= NUMBERS[key].high
    assert set(NUMBERS) == set(nominal)


def test_unknown_terms_survive_the_round_trip(tmp_path):
    plant = PlantDescription(
        effects=(EffectSpec('joint_backlash', 'bend_x', {'gap_rad': 0.1}),),
        terms=(
            TermSpec('bend_y', 'exponent_of_speed', '0.3*exp(-v / 1e-3)  ', range=(0.0, 0.01)),
            TermSpec('bend_y', 'load_of_angle', '1e-3*sin(q)'),
            TermSpec('bend_y', 'load_of_time', '0.2*sin(t)', multiplies=True),
            TermSpec('bend_y', 'load_of_relaxing_angle', '-1e-3*z', lag_s=2.5),
            TermSpec('bend_x', 'load_of_angle', values=tuple(1e-5 * k for k in range(NODES))),
        ),
    )
    save_plant(plant, tmp_path / 'plant.yaml')
    assert load_plant(tmp_path / 'plant.yaml') == plant


def entry(more):
    return f'effects: [{{id: unknown_term, joint: bend_x, {more}}}]'


@pytest.mark.parametrize(
    ('more', 'message'),
    [
        ('place: load_of_angle, expression: q', 'effects[0].stage is missing'),
        ('stage: joynt, place: load_of_angle', 'unknown stage joynt: did you mean joint?'),
        ('stage: joint, place: load_of_angle, expression: 0.01*q, lag_s: 1', 'does not lag'),
        ('stage: joint, place: load_of_relaxing_angle, expression: 0.01*z, lag_s: 0', '0.05 to'),
        (
            'stage: joint, place: load_of_angle, expression: q, multiplies: true',
            'multiplies nothing',
        ),
        ('stage: joint, expression: q', 'place is missing: valid are end_way_of_angle'),
        ('stage: joint, place: load_of_angel', 'did you mean load_of_angle?'),
        ('stage: joint, place: pulley_of_shaft', 'a place of the stage actuator, not joint'),
        ('stage: joint, place: load_of_angle', 'give either an expression or values'),
        ('stage: joint, place: load_of_angle, values: [1, 2]', '2 values: give 41'),
        ('stage: joint, place: load_of_angle, expression: q, range: [1, 1]', 'the lower first'),
        ('stage: joint, place: load_of_angle, expression: 0.01*t', 'unknown name t: valid are q'),
        ('stage: joint, place: load_of_angle, expression: 0.01*tnh(q)', 'did you mean tanh?'),
        ('stage: joint, place: load_of_angle, expression: 0.01/q', 'no finite value at q = 0:'),
        ('stage: joint, place: load_of_angle, expression: log(q)', 'no finite value at q = -2'),
        ('stage: joint, place: load_of_angle, expression: 9**9**9', 'no finite value'),
        ('stage: joint, place: load_of_angle, expression: "q +"', "'q +' is not a formula"),
        ('stage: joint, place: load_of_angle, expression: "q if q else 1"', 'is not one of'),
        ('stage: joint, place: load_of_angle, expression: q.real', "'q.real' is not one of"),
        ('stage: joint, place: load_of_angle, expression: "exp(q, q)"', 'exp takes one argument'),
        ('stage: joint, place: load_of_angle, expression: max(q)', 'two arguments or more'),
        (f'stage: joint, place: load_of_angle, expression: {"-" * 60}q', 'write it shorter'),
        (f'stage: joint, place: load_of_angle, expression: q{"+q" * 400}', 'give 400 at most'),
        ('stage: joint, place: load_of_angle, expression: q', 'reaches -2 N m: it must stay'),
        ('stage: joint, place: load_of_angle, expression: 0.01*sin(300*q)', 'too fine for 41'),
        ('stage: joint, place: load_of_speed, expression: 1e-5*w**2', 'is not odd: the place'),
        ('stage: joint, place: load_of_speed_size, expression: 1e-5*w', 'is not even'),
        ('stage: joint, place: load_periodic, expression: 1e-3*t', 'the range is the period'),
        ('stage: joint, place: load_of_speed, expression: 0, range: [0, 1]', 'on both sides'),
        ('stage: transmission, place: film_drag_of_speed, expression: -1000*v', 'not be negative'),
    ],
)
def test_a_wrong_unknown_term_is_named_in_one_line(tmp_path, more, message):
    with pytest.raises(FileError) as caught:
        load_plant(written(tmp_path, entry(more)))
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_place_has_one_function_and_a_joint_that_there_is(tmp_path):
    term = '{id: unknown_term, joint: bend_x, stage: joint, place: load_of_angle, expression: 0}'
    with pytest.raises(FileError, match='given twice on joint bend_x'):
        load_plant(written(tmp_path, f'effects: [{term}, {term}]'))
    with pytest.raises(FileError, match='unknown_term at load_of_angle is on joint bend_z'):
        load_plant(written(tmp_path, f'effects: [{term.replace("bend_x", "bend_z")}]'))
