import pytest

from endoscope_core.control import FeedforwardLaw
from endoscope_core.identification.law_choice import (
    CalibrationFindings,
    LawChoice,
    LawChoiceError,
)
from endoscope_core.identification.updated_table import UpdatedTableError


def test_a_law_is_never_guessed(tmp_path):
    choice = LawChoice(2)
    nothing = CalibrationFindings()
    assert choice.law('none', 'class', nothing) == FeedforwardLaw()
    for by in ('class', 'size', 'plant'):
        with pytest.raises(LawChoiceError, match='did not'):
            choice.law('physical', by, nothing)
    with pytest.raises(LawChoiceError, match='not selected by plant'):
        choice.law('play', 'plant', nothing)
    with pytest.raises(LawChoiceError, match='unknown selection'):
        choice.law('play', 'dice', nothing)
    with pytest.raises(UpdatedTableError, match='outside the table'):
        choice.law('play', 'size', CalibrationFindings(size=3.0))
    with pytest.raises(UpdatedTableError, match='missing'):
        LawChoice(2, table=str(tmp_path / 'none')).law('play', 'size', CalibrationFindings(size=1))
