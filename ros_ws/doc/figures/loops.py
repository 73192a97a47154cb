"""Loops of bending over desired angle, for three tubes of the shipped family."""

import matplotlib.pyplot as plt
import numpy as np

from endoscope_core.physics import PlantDescription, simulate
from endoscope_core.physics.family import shipped_family
from endoscope_core.rig import shipped_rig

time = np.arange(0.0, 4.0 * np.pi, 1e-3)
desired = np.deg2rad(60.0 * np.sin(time))
command = shipped_rig().joints.gear * desired[:, np.newaxis]
last = time >= 2.0 * np.pi

figure, axes = plt.subplots(figsize=(6.4, 3.6), layout='constrained')
axes.plot([-60, 60], [-60, 60], color='0.7', linewidth=1.0, label='as desired')
for bend_deg in (0.0, 120.0, 240.0):
    joint = shipped_family().joint(np.deg2rad(bend_deg))
    moved = simulate(PlantDescription(joints={'bend_x': joint}), command)
    axes.plot(
        np.rad2deg(desired[last]),
        np.rad2deg(moved.bending_true[last, 0]),
        label=f'tube bent by {bend_deg:.0f} deg',
    )
axes.set_xlabel('desired angle [deg]')
axes.set_ylabel('bending angle [deg]')
axes.legend(frameon=False, fontsize=9)
