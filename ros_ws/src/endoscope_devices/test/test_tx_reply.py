import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_devices.em_tracker.tx_reply import MalformedReplyError, PortStatus, parse_tx

# Option 0001 with two sensors, the second out of volume, after the guide's table for TX.
TEXT = (
    '020A-00720+07250+00000+06848-000231+001400-176150+001230000003100000A5B\n'
    '0BMISSING0000007100000A5B\n'
    '0000'
)


def test_a_reply_is_read_in_si_units():
    first, second = parse_tx(TEXT)
    assert (first.handle, first.frame) == (0x0A, 0xA5B)
    assert first.status == PortStatus.OCCUPIED | PortStatus.INITIALIZED | PortStatus.ENABLED
    np.testing.assert_allclose(first.position, (-0.00231, 0.014, -1.7615))
    np.testing.assert_allclose(first.orientation, (0.725, 0.0, 0.6848, -0.072), atol=4e-4)
    assert math.hypot(*first.orientation) == pytest.approx(1.0)
    assert first.error == pytest.approx(0.0000123)
    assert second.position == ()
    assert PortStatus.OUT_OF_VOLUME in second.status


def test_disabled_and_unplugged_tools_are_left_out():
    text = '03' + '0ADISABLED\n' + '0BUNOCCUPIED\n' + TEXT[2 : TEXT.index('0B')] + '0000'
    assert [tool.handle for tool in parse_tx(text)] == [0x0A]


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'no number of handles'),
        ('OKAY', 'no number of handles'),
        ('ERROR0C', 'no number of handles'),
        ('01' + TEXT[2:], 'no system status'),
        ('03' + TEXT[2:], 'no tool'),
        (TEXT.replace('-00720', '-0072O'), 'no tool'),
        (TEXT.replace('+07250', '+17250'), 'quaternion of length'),
        (TEXT.replace('-176150', '-976150'), 'a sensor at'),
        (TEXT.replace('-000231', '-00231'), 'no tool'),
        (TEXT + '0', 'no system status'),
        (TEXT.replace('00000A5B', '00000a5b'), 'no tool'),
    ],
)
def test_any_character_out_of_place_is_refused(text, words):
    with pytest.raises(MalformedReplyError, match=words):
        parse_tx(text)


@given(st.text(alphabet='0123456789ABCDEF+-MISNGDLU\n', max_size=200))
def test_arbitrary_text_is_refused_or_whole(text):
    try:
        tools = parse_tx(text)
    except MalformedReplyError:
        return
    assert len(tools) <= int(text[:2], 16)
