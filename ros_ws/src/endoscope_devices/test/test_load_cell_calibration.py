import struct

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.errors import FileError
from endoscope_devices.load_cells import load_calibration
from endoscope_devices.load_cells.calibration_file import REGISTER_TYPES, decode_number

WIRES = ('left', 'right')


def content():
    return {
        'transmitter': {'unit': 3, 'registers': 'holding', 'word_order': 'little'},
        'wires': {
            'right': {'register': 4, 'type': 'int16', 'newton_per_count': 0.01, 'sign': -1},
            'left': {'register': 2, 'type': 'float32', 'newton_per_count': 2.0, 'zero': 5},
        },
        'faults': {
            'broken_below': -30000,
            'broken_above': 30000,
            'saturated_below': -20000,
            'saturated_above': 20000,
        },
    }


def load(tmp_path, text):
    path = tmp_path / 'cells.yaml'
    path.write_text(text if isinstance(text, str) else yaml.safe_dump(text))
    return load_calibration(path, WIRES)


def test_a_file_becomes_a_calibration(tmp_path):
    calibration = load(tmp_path, content())
    assert (calibration.transmitter.unit, calibration.transmitter.function) == (3, 3)
    assert calibration.transmitter.word_order == 'little'
    assert tuple(calibration.wires) == WIRES
    assert calibration.wires['left'].tension(8.0) == pytest.approx(6.0)
    assert calibration.wires['right'].tension(-400.0) == pytest.approx(4.0)
    assert calibration.faults.frozen_after == 0.5
    assert calibration.transmitter.latency == 0.0


def without(key, *path):
    changed = content()
    place = changed
    for step in path:
        place = place[step]
    del place[key]
    return changed


def given_as(value, key, *path):
    changed = content()
    place = changed
    for step in path:
        place = place.setdefault(step, {})
    place[key] = value
    return changed


@pytest.mark.parametrize(
    ('changed', 'words'),
    [
        (given_as(1, 'uint'), 'unknown key uint'),
        (given_as(1, 'unti', 'transmitter'), 'transmitter: unknown key unti: did you mean unit'),
        (given_as({}, 'middle', 'wires'), 'unknown key middle'),
        (without('left', 'wires'), 'left is missing'),
        (given_as(-1.0, 'newton_per_count', 'wires', 'left'), 'newton_per_count is -1.0'),
        (given_as(0, 'unit', 'transmitter'), 'unit is 0'),
        (given_as('middle', 'word_order', 'transmitter'), "word_order is 'middle'"),
        (given_as(0.5, 'sign', 'wires', 'left'), 'sign is 0.5'),
        (given_as(3, 'register', 'wires', 'right'), 'left and right share register 3'),
        (given_as(500, 'register', 'wires', 'right'), 'one Modbus reply carries 125'),
        (given_as(-40000, 'saturated_below', 'faults'), 'broken_below <= saturated_below'),
        (given_as('mark', 'parity', 'transmitter', 'serial'), "parity is 'mark'"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(tmp_path, changed, words):
    with pytest.raises(FileError, match=words) as caught:
        load(tmp_path, changed)
    assert '\n' not in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileError, match=r'cannot read .*nowhere'):
        load_calibration(tmp_path / 'nowhere.yaml', WIRES)


@given(st.sampled_from(list(REGISTER_TYPES)), st.data(), st.booleans())
def test_numbers_survive_the_way_through_registers(kind, data, big):
    form = REGISTER_TYPES[kind].format
    values = {
        'h': st.integers(-(2**15), 2**15 - 1),
        'H': st.integers(0, 2**16 - 1),
        'i': st.integers(-(2**31), 2**31 - 1),
        'I': st.integers(0, 2**32 - 1),
        'f': st.floats(width=32, allow_nan=False),
    }
    value = data.draw(values[form[1]])
    raw = struct.pack(form, value)
    words = struct.unpack(f'>{len(raw) // 2}H', raw)
    assert decode_number(words if big else words[::-1], kind, big) == value
