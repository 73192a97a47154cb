"""Travel of the wires that is not proportional to the motor's angle."""

import numpy as np
from physics_rig import BLOCKED, run

RAMP = np.linspace(0.0, 0.5, 800)


def test_hinged_rings_give_and_take_what_was_measured_of_them():
    # Three hinges whose wires pass at 1.2 mm from the middle and 0.3 mm above them.
    angle = np.deg2rad(60.0)
    odd = 2.0 * 3 * 1.2e-3 * np.sin(angle / 6.0)
    even = 2.0 * 3 * 0.3e-3 * (1.0 - np.cos(angle / 6.0))
    np.testing.assert_allclose([odd - even, odd + even], [1.22e-3, 1.28e-3], atol=5e-6)
    shaft = np.linspace(0.0, odd / 0.0024, 800)
    given = {'asymmetry': even * 0.0024 / odd**2}
    stiff = run(shaft, {'wire_geometry': given}, motor=shaft, wire_stiffness=2000.0, **BLOCKED)
    taken = (stiff.a[-1] - 5.0) / 2000.0
    gave = (5.0 - stiff.b[-1]) / 2000.0
    np.testing.assert_allclose([taken, gave], [1.22e-3, 1.28e-3], atol=1e-5)
