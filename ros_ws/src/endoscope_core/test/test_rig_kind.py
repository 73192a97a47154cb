"""What kind of rig a recording is of, and what is not taken for it."""

import pytest

from endoscope_core.rig import Kind, RigKind, kind_from_text, kind_of_several

EMULATED = RigKind(Kind.EMULATED, 'endoscope 1.2', 'a1' * 32)
SIMULATED = RigKind(Kind.SIMULATED, 'endoscope 1.2', 'a1' * 32, 'stiff.yaml', 'b2' * 32)


@pytest.mark.parametrize('rig', [EMULATED, SIMULATED, RigKind(Kind.REAL), RigKind()])
def test_it_is_read_as_it_was_written(rig):
    assert kind_from_text(rig.as_text()) == rig


@pytest.mark.parametrize(
    'text', ['', 'real', '[real]', 'kind: [real]', 'kind: Real', 'kind: {real', '<robot/>', '\0']
)
def test_what_says_something_else_is_no_real_rig(text):
    assert kind_from_text(text) == RigKind()


def test_a_later_version_may_say_more():
    assert kind_from_text('kind: real\nyear: 2027\n') == RigKind(Kind.REAL)


def test_several_are_a_real_rig_only_if_all_of_them_are():
    real = RigKind(Kind.REAL)
    assert kind_of_several([]) == RigKind()
    assert kind_of_several([real, real]) == real
    assert kind_of_several([real, EMULATED]) == EMULATED
    assert kind_of_several([real, RigKind()]) == RigKind()
    assert kind_of_several([EMULATED, SIMULATED]) == SIMULATED
