"""Load cells that see each other."""

import numpy as np
import pytest
from physics_rig import hand, run

COMMAND = hand(2000, 1e-3)


@pytest.mark.parametrize('wire', [0.0, 1.0, 2.0])
def test_each_cell_that_is_meant_sees_its_true_neighbour(wire):
    nominal = run(COMMAND)
    done = run(COMMAND, {'load_cell_crosstalk': {'share': 0.25, 'wire': wire}})
    a = nominal.a + (0.25 * nominal.b if wire in (0.0, 2.0) else 0.0)
    b = nominal.b + (0.25 * nominal.a if wire in (1.0, 2.0) else 0.0)
    np.testing.assert_allclose(done.a, a, atol=1e-12)
    np.testing.assert_allclose(done.b, b, atol=1e-12)
    np.testing.assert_array_equal(done.effort, nominal.effort)
