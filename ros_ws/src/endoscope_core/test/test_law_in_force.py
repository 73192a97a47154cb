"""The law in force follows from mode, findings and plant, and is never guessed."""

import pytest

from endoscope_core.compensation.law_in_force import LawInForce, Selection
from endoscope_core.control import (
    AdoptedPlant,
    Feedforward,
    FeedforwardSettings,
    MotorLimits,
    PhysicalParameters,
)
from endoscope_core.identification.law_choice import CalibrationFindings, LawChoice
from endoscope_core.physics import PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_core.safety import BendingRange

DAHL, ADOPTED = Selection('dahl', 'class'), Selection('physical', 'adopted')
FOUND = CalibrationFindings(class_deg=70, ranges=(BendingRange(-0.5, 0.5),) * 2)


def law_of(selection=DAHL, **files):
    settings = FeedforwardSettings(MotorLimits.of(shipped_rig()))
    return LawInForce(Feedforward(2, settings), LawChoice(2, **files), selection)


def plant(text):
    joints = PlantDescription().joints.values()
    parameters = tuple(PhysicalParameters(joint) for joint in joints)
    return AdoptedPlant(text, parameters, (BendingRange(-0.2, 0.2),) * 2, (), (0.0, 1.0))


def test_nothing_is_compensated_before_a_calibration():
    law = law_of()
    law.select(DAHL)
    assert law.feedforward.law.mode == 'none'
    assert law.ranges == ()
    assert law.in_words('calibrate') == 'no feed-forward: dahl waits for a calibration; calibrate'


def test_a_calibration_is_in_force_once_nothing_moves():
    law = law_of()
    law.changed, law.pending = False, (FOUND,)
    assert law.feedforward.law.mode == 'none'
    law.take_pending()
    assert law.feedforward.law.mode == 'dahl'
    assert law.ranges == FOUND.ranges
    assert law.changed
    assert law.in_words('') == 'dahl by class: class 70 deg'
    law.pending = (None,)  # of a tube of no class
    law.take_pending()
    assert law.feedforward.law.mode == 'none'
    assert law.ranges == ()


def test_what_was_not_found_is_an_error_and_compensates_nothing():
    law = law_of()
    law.pending = (FOUND,)
    law.take_pending()
    law.select(Selection('physical', 'plant'))
    assert law.feedforward.law.mode == 'none'
    assert law.error == 'the calibration did not identify the plant'
    assert law.in_words('') == f'no feed-forward: {law.error}'


def test_a_file_that_cannot_be_used_is_an_error_from_the_start(tmp_path):
    assert 'missing' in law_of(parameter_sets=str(tmp_path / 'missing.yaml')).error


def test_plants_are_undone_one_by_one():
    law = law_of()
    for text in ('first', 'second'):
        law.adopt(plant(text), for_session=False)
        law.select(ADOPTED)
        assert law.in_words('') == f'physical by adopted: plant {law.plant.hash}'
        assert law.ranges == law.plant.ranges
    assert law.before.plant.text == 'first'
    assert law.before.selection == ADOPTED
    law.undo()
    assert law.plant.text == 'first'
    assert law.before.selection == DAHL
    law.undo()
    assert (law.plant, law.before) == (None, None)


@pytest.mark.parametrize(('for_session', 'left'), [(True, None), (False, 'adopted')])
def test_a_plant_adopted_in_a_session_of_other_parameters_goes_with_it(for_session, left):
    law = law_of()
    law.adopt(plant('adopted'), for_session)
    law.end_session()
    assert (law.plant and law.plant.text) == left
