"""Plants that recordings are explained by."""

import pytest

from endoscope_console.background import BackgroundCommand
from endoscope_console.explanations import Explanations
from endoscope_core.errors import EndoscopeError


def test_the_plant_of_the_graph_may_be_named_as_the_page_names_it(tmp_path):
    bags, own = tmp_path / 'bags', tmp_path / 'hidden.yaml'
    bags.mkdir()
    own.touch()
    explanations = Explanations(bags, BackgroundCommand())
    for named in (None, str(own)):
        assert explanations.plant_file(named, str(own)) == own
    with pytest.raises(EndoscopeError, match='there is no plant'):
        explanations.plant_file(str(own), 'nominal_plant')
