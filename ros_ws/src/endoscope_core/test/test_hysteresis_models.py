import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safe_parameters import SAFE
from scipy.integrate import solve_ivp

from endoscope_core.hysteresis import MODELS, DahlParameters, direct_inverse
from endoscope_core.hysteresis.dahl import dahl_step
from endoscope_core.hysteresis.memory_model import GREATEST_INVERSE_SLOPE, DirectInverse

TIME = np.arange(0.0, 9.0, 0.01)
MOTION = 0.9 * np.sin(TIME) + 0.5 * np.sin(1.73 * TIME)
steps = st.floats(-1e6, 1e6) | st.floats(-1.0, 1.0) | st.floats(-1e-9, 1e-9)


@given(st.floats(-1.0, 1.0), st.lists(steps, max_size=30), st.floats(0.01, 1.0), st.floats(0.5, 4))
def test_dahl_stays_in_bounds_and_goes_with_its_driver(y, moves, travel, exponent):
    for move in moves:
        after = dahl_step(y, move, travel, exponent)
        assert -1.0 <= after <= 1.0
        assert (after - y) * np.sign(move) >= -1e-15
        y = after


@pytest.mark.parametrize('exponent', [0.6, 1.0, 1.7, 3.0])
def test_dahl_solves_its_equation(exponent):
    path, y = np.array([0.0, 1e-3, 0.3, 0.31, 0.9]), -0.7
    found = [y]
    for step in np.diff(path):
        found.append(dahl_step(found[-1], step, 0.5, exponent))
    truth = solve_ivp(
        lambda _, v: max(0.0, 1.0 - v[0]) ** exponent / 0.5,
        (0.0, 0.9),
        [y],
        t_eval=path,
        rtol=1e-9,
        atol=1e-11,
    ).y[0]
    np.testing.assert_allclose(found, truth, atol=1e-6)


@pytest.mark.parametrize('name', MODELS)
@given(st.lists(st.floats(-1.7, 1.7), min_size=2, max_size=30))
@settings(max_examples=20)
def test_inverses_keep_to_the_slope_that_they_state(name, points):
    inverse = DirectInverse(SAFE[name], 0.3, points[0])
    assert SAFE[name].inverse_slope <= GREATEST_INVERSE_SLOPE
    before, angle = inverse.command(), points[0]
    for target in points[1:]:
        for part in np.linspace(angle, target, 20)[1:]:
            inverse.move_to(part)
            command = inverse.command()
            change = abs(command - before)
            assert change <= SAFE[name].inverse_slope * abs(target - angle) / 19.0 + 1e-9
            assert (command - before) * (target - angle) >= -1e-9
            before = command
        angle = target
        assert -1.0 - 1e-9 <= inverse.direction <= 1.0 + 1e-9


@pytest.mark.parametrize('name', MODELS)
def test_steps_of_the_inverse_are_those_of_the_whole_series(name):
    inverse, commands = DirectInverse(SAFE[name], 0.0, MOTION[0]), []
    for angle in MOTION:
        inverse.move_to(angle)
        commands.append(inverse.command())
    np.testing.assert_allclose(commands, direct_inverse(SAFE[name], MOTION), atol=1e-12)


@pytest.mark.parametrize('name', MODELS)
def test_parameters_survive_a_file_and_nothing_else_is_taken(name):
    values = SAFE[name].to_dict()
    assert MODELS[name].from_dict(values) == SAFE[name]
    with pytest.raises(ValueError, match='must be exactly'):
        MODELS[name].from_dict({**values, 'gamma': 1.0})


@pytest.mark.parametrize(
    ('make', 'complaint'),
    [
        (lambda: DahlParameters(0.9, 0.5, 0.001, 1.0), 'too steep'),
        (lambda: DahlParameters(0.9, 0.5, 0.1, 9.0), 'exponent'),
        (lambda: DahlParameters(math.nan, 0.5, 0.1, 1.0), 'finite'),
        (lambda: DahlParameters(0.1, 0.5, 0.1, 1.0), 'alpha'),
        (lambda: DahlParameters(0.9, 9.0, 1.0, 1.0), 'lag'),
        (lambda: DahlParameters(0.9, 0.5, 0.1, 1.0, 2.0), 'offset'),
    ],
)
def test_unsafe_parameters_are_refused(make, complaint):
    with pytest.raises(ValueError, match=complaint):
        make()
