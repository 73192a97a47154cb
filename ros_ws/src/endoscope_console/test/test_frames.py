import math
import struct
from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from page_frames import decode_telemetry, encode_input

from endoscope_console.teleop.frames import (
    POINTS,
    InputDevice,
    InputFrame,
    MalformedFrameError,
    decode_input,
    encode_telemetry,
)

FRAME = InputFrame(
    pressed=True,
    turbo=False,
    visible=True,
    focused=True,
    position_mode=True,
    source=InputDevice.POINTER,
    seq=7,
    grip=3,
    seen=1000,
    t=12.25,
    x=-0.5,
    y=0.25,
)
U32 = st.integers(0, 2**32 - 1)
F32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
FRAMES = st.builds(
    InputFrame,
    *[st.booleans()] * 5,
    st.sampled_from([InputDevice.KEYBOARD, InputDevice.POINTER, InputDevice.GAMEPAD]),
    *[U32] * 3,
    st.floats(0.0, 1e9),
    F32,
    F32,
)


def test_an_input_frame_lies_in_32_bytes_as_a_page_writes_it():
    assert encode_input(FRAME) == (
        bytes([2, 1 + 4 + 8 + 16])
        + (1).to_bytes(2, 'little')
        + (7).to_bytes(4, 'little')
        + (3).to_bytes(4, 'little')
        + (1000).to_bytes(4, 'little')
        + struct.pack('<d', 12.25)
        + struct.pack('<f', -0.5)
        + struct.pack('<f', 0.25)
    )
    assert len(encode_input(FRAME)) == 32


@given(FRAMES)
def test_what_was_written_is_read(frame):
    assert decode_input(encode_input(frame)) == frame


@given(st.binary(max_size=40) | st.binary(min_size=30, max_size=30).map(lambda b: b'\2\1' + b))
def test_random_bytes_are_a_frame_of_finite_numbers_or_refused(data):
    try:
        frame = decode_input(data)
    except MalformedFrameError:
        return
    assert all(math.isfinite(number) for number in astuple(frame))
    assert encode_input(frame) == data


@pytest.mark.parametrize(
    ('data', 'message'),
    [
        (b'', '32 bytes, not 0'),
        (encode_input(FRAME)[:-1], '32 bytes, not 31'),
        (encode_input(FRAME) + b'\0', '32 bytes, not 33'),
        (b'\1' + encode_input(FRAME)[1:], 'kind 2, not 1'),
        (b'\2\x3d' + encode_input(FRAME)[2:], 'flags 0x20'),
        (encode_input(replace(FRAME, source=3)), 'source 3'),
        (encode_input(replace(FRAME, source=65535)), 'source 65535'),
        (encode_input(replace(FRAME, t=math.nan)), 'nan'),
        (encode_input(replace(FRAME, t=1e300)), '1e+300'),
        (encode_input(replace(FRAME, x=math.inf)), 'inf'),
        (encode_input(replace(FRAME, y=-math.inf)), '-inf'),
    ],
)
def test_what_is_no_input_frame_is_refused_with_a_reason(data, message):
    with pytest.raises(MalformedFrameError, match=message.replace('+', r'\+')):
        decode_input(data)


def test_a_telemetry_frame_of_12_signals_lies_in_1128_bytes():
    ranges = np.arange(36.0).reshape(12, 3)
    wanted = np.linspace(0.0, 1.0, 3 * POINTS).reshape(POINTS, 3)
    data = encode_telemetry(5, 100.5, 0.002, ranges, wanted, -wanted)
    assert len(data) == 1128
    assert data[:24] == struct.pack('<BBHIdd', 1, 1, 12, 5, 100.5, 0.002)
    assert struct.unpack_from('<fff', data, 24) == (0.0, 1.0, 2.0)
    assert struct.unpack_from('<f', data, 24 + 12 * 12 + 12 * POINTS - 4) == (1.0,)
    assert struct.unpack_from('<f', data, 1128 - 4) == (-1.0,)


@given(st.integers(0, 40), U32, st.data())
def test_a_picture_that_was_written_is_read_with_what_is_unknown_in_it(count, seq, data):
    numbers = data.draw(
        st.lists(F32 | st.just(math.nan), min_size=3 * count, max_size=3 * count), 'numbers'
    )
    ranges = np.array(numbers).reshape(count, 3)
    unknown = np.full((POINTS, 3), np.nan)
    line = np.ones((POINTS, 3))
    frame = decode_telemetry(encode_telemetry(seq, 1.5, math.nan, ranges, line, unknown))
    assert (frame.seq, frame.stamp_s) == (seq, 1.5)
    assert math.isnan(frame.age_s)
    np.testing.assert_array_equal(frame.ranges, ranges)
    np.testing.assert_array_equal(frame.wanted, line)
    np.testing.assert_array_equal(frame.actual, unknown)
