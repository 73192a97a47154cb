from endoscope_core.control import PhysicalParameters
from endoscope_core.plant import JointParameters
from endoscope_core.trials.crossing_bound import crossing_bound


def test_a_search_betters_the_crossing_and_releasing_before_betters_both():
    parameters = PhysicalParameters(JointParameters(capstan_exponent=1.3))
    bound = crossing_bound(parameters, seed=0, tries=1500)
    assert bound.best < bound.crossing
    assert bound.releasing < bound.best
    assert bound == crossing_bound(parameters, seed=0, tries=1500)
