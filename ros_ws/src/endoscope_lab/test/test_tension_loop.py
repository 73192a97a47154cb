import numpy as np
import pytest
from outside_data import REAL, needs

from endoscope_core.metrics import width_at_mid_height
from endoscope_core.physics import simulate
from endoscope_core.signals import calibration_motion
from endoscope_lab.dataset import random_instrument
from endoscope_lab.dataset.rig_variation import backlash_sizes, calibration_command, in_tube
from endoscope_lab.papers.real_recordings import leave_one_out_errors, tension_loop_width


def test_a_loop_of_known_width():
    phase = np.linspace(0.0, 2.0 * np.pi, 2001)
    lead = 0.3
    pull = np.sin(phase + lead)
    width = tension_loop_width(60.0 * np.sin(phase), 5.0 + pull, 5.0 - pull)
    assert width == pytest.approx(120.0 * np.sin(lead), abs=0.05)


def test_on_the_simulated_rig_much_friction_makes_it_narrower():
    motion = calibration_motion()
    settled = slice(motion.settled, motion.samples)
    desired = motion.signal(np.arange(motion.samples) * 1e-3)[0][settled]
    sizes, widths = [], []
    instrument = random_instrument(np.random.default_rng(0))
    for bend in (0.0, 1.5, 3.0):
        plant = in_tube(instrument, bend)
        tension = simulate(plant, calibration_command(plant, motion)).tension[settled, 0]
        sizes.append(backlash_sizes(plant)[0])
        widths.append(tension_loop_width(desired, *tension.T))
    assert np.all(np.diff(sizes) > 0.0)
    assert np.all(np.diff(widths) < 0.0)


@needs(REAL)
def test_real_backlash_sizes_from_tension_alone():
    sizes, widths = [], []
    for path in sorted(REAL.glob('[0-9]*.txt')):
        table = np.loadtxt(path, delimiter=',')
        table = table[np.diff(table[:, 0], prepend=-1.0) != 0.0]
        time, desired, actual = table[:, 0], table[:, 1], table[:, 3]
        loop = (time >= 0.5 * np.pi) & (time < 2.5 * np.pi)
        sizes.append(width_at_mid_height(desired[loop], actual[loop]))
        widths.append(tension_loop_width(desired[loop], table[loop, 4], table[loop, 5]))
    rms = np.sqrt(np.mean(leave_one_out_errors(widths, sizes) ** 2))
    assert len(sizes) == 5
    assert rms < 2.5
