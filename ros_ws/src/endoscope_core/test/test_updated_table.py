import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from safe_parameters import SAFE

from endoscope_core.control import PhysicalParameters
from endoscope_core.errors import FileError, InputError
from endoscope_core.hysteresis import BoucWenParameters, DahlParameters
from endoscope_core.hysteresis.memory_model import GREATEST_INVERSE_SLOPE
from endoscope_core.identification import KINDS, TableEntry, UpdatedTable, blend
from endoscope_core.physics import JointParameters

OTHER = {
    'bouc_wen': BoucWenParameters.from_shape(0.8, 0.8, 0.06, 0.4, 3.5),
    'dahl': DahlParameters(1.2, 0.9, 0.08, 0.7, 0.1),
    'physical': PhysicalParameters(JointParameters(capstan_exponent=1.8, joint_rest_angle=-0.1)),
}
FIRST = SAFE | {
    'physical': PhysicalParameters(
        JointParameters(capstan_exponent=0.4, joint_rest_angle=0.1, friction_profile=(0.3,))
    )
}


@pytest.mark.parametrize('model', KINDS)
@given(st.floats(0.0, 1.0))
def test_between_safe_parameters_all_are_safe(model, weight):
    between = blend(FIRST[model], OTHER[model], weight)
    assert isinstance(between, KINDS[model])
    if model != 'physical':
        steepest = max(FIRST[model].inverse_slope, OTHER[model].inverse_slope)
        assert between.inverse_slope <= min(steepest, GREATEST_INVERSE_SLOPE) * (1.0 + 1e-6)


def test_a_plant_between_two_has_the_friction_and_the_rest_angle_between_theirs():
    joint = blend(FIRST['physical'], OTHER['physical'], 0.25).joint
    assert joint.capstan_exponent == pytest.approx(0.4**0.75 * 1.8**0.25)
    assert joint.joint_rest_angle == pytest.approx(0.05)
    assert joint.friction_profile == pytest.approx((0.225,))


@pytest.mark.parametrize('model', KINDS)
def test_a_table_gives_its_entries_survives_a_file_and_grows(model, tmp_path):
    path = tmp_path / 'table.json'
    table = UpdatedTable.of(
        model, [TableEntry(1.4, OTHER[model], 'second'), TableEntry(0.7, FIRST[model], 'first')]
    )
    assert table.sizes == (0.7, 1.4)
    assert table.parameters_for(0.7) == FIRST[model]
    assert table.parameters_for(1.4) == OTHER[model]
    middle = table.parameters_for(1.05)
    assert middle not in (FIRST[model], OTHER[model])
    grown = table.extended(TableEntry(1.05, OTHER[model], 'new calibration'))
    assert grown.sizes == (0.7, 1.05, 1.4)
    assert grown.parameters_for(1.05) == OTHER[model]
    again = grown.extended(TableEntry(1.05 + math.radians(0.3), FIRST[model], 'once more'))
    assert len(again.entries) == 3
    again.save(path)
    assert UpdatedTable.load(path) == again


@pytest.mark.parametrize('size', [0.69, 1.41, math.nan, math.inf, -1.0])
def test_outside_its_range_a_table_refuses(size):
    table = UpdatedTable.of(
        'dahl', [TableEntry(0.7, FIRST['dahl']), TableEntry(1.4, OTHER['dahl'])]
    )
    with pytest.raises(InputError, match='outside the table'):
        table.parameters_for(size)


@pytest.mark.parametrize(
    ('make', 'complaint'),
    [
        (lambda: UpdatedTable.of('preisach', []), 'unknown model'),
        (lambda: UpdatedTable.of('dahl', []), 'at least one'),
        (lambda: UpdatedTable.of('dahl', [TableEntry(1.0, FIRST['bouc_wen'])]), 'holds Bouc'),
        (lambda: UpdatedTable.of('dahl', [TableEntry(math.nan, FIRST['dahl'])]), 'finite'),
        (lambda: UpdatedTable.of('dahl', [TableEntry(1.0, FIRST['dahl'])] * 2), 'increase'),
    ],
)
def test_tables_that_make_no_sense_are_refused(make, complaint):
    with pytest.raises(InputError, match=complaint):
        make()


@pytest.mark.parametrize(
    'content', ['', '[]', '{"model": "dahl"}', '{"model": "dahl", "entries": [{"size": 1}]}']
)
def test_a_file_that_holds_no_table_is_refused(content, tmp_path):
    path = tmp_path / 'table.json'
    path.write_text(content)
    with pytest.raises(FileError, match='no updated table'):
        UpdatedTable.load(path)
    with pytest.raises(FileError, match='missing'):
        UpdatedTable.load(tmp_path / 'nowhere.json')


def test_unsafe_parameters_in_a_file_are_refused(tmp_path):
    path = tmp_path / 'table.json'
    UpdatedTable.of('dahl', [TableEntry(1.0, FIRST['dahl'])]).save(path)
    content = json.loads(path.read_text())
    content['entries'][0]['parameters']['travel'] = 1e-3
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match='too steep'):
        UpdatedTable.load(path)


def test_kinds_that_differ_are_not_blended():
    with pytest.raises(ValueError, match='cannot be blended'):
        blend(FIRST['bouc_wen'], FIRST['dahl'], 0.5)
    with pytest.raises(ValueError, match='weight'):
        blend(FIRST['dahl'], FIRST['dahl'], 1.5)
