import pytest

from endoscope_core.control import FeedforwardLaw
from endoscope_core.errors import FileError, InputError
from endoscope_core.identification.law_choice import CalibrationFindings, LawChoice


def test_a_law_is_never_guessed(tmp_path):
    choice = LawChoice(2)
    nothing = CalibrationFindings()
    assert choice.law('none', 'class', nothing) == FeedforwardLaw()
    for by in ('class', 'size', 'plant'):
        with pytest.raises(InputError, match='did not'):
            choice.law('physical', by, nothing)
    with pytest.raises(InputError, match='not selected by plant'):
        choice.law('dahl', 'plant', nothing)
    with pytest.raises(InputError, match='unknown selection'):
        choice.law('dahl', 'dice', nothing)
    with pytest.raises(InputError, match='outside the table'):
        choice.law('dahl', 'size', CalibrationFindings(size=3.0))
    with pytest.raises(FileError, match='missing'):
        LawChoice(2, table=str(tmp_path / 'none')).law('dahl', 'size', CalibrationFindings(size=1))
