"""Tension along a sheath while the wire is pulled, just after the motor turned, and let go."""

import matplotlib.pyplot as plt
import numpy as np

EXPONENT = 0.9
AT_THE_JOINT = 4.0  # N
FRONT = 0.35  # how far the turn has travelled, as a share of the sheath

along = np.linspace(0.0, 1.0, 200)
pulled = AT_THE_JOINT * np.exp(EXPONENT * (1.0 - along))
meeting = AT_THE_JOINT * np.exp(EXPONENT * (1.0 - FRONT))
turned = np.where(along < FRONT, meeting * np.exp(EXPONENT * (along - FRONT)), pulled)
let_go = AT_THE_JOINT * np.exp(EXPONENT * (along - 1.0))

figure, axes = plt.subplots(figsize=(6.4, 3.0), layout='constrained')
axes.plot(along, pulled, label='pulled')
axes.plot(along, turned, label='just after the motor turned')
axes.plot(along, let_go, label='let go')
axes.set_xlabel('place along the sheath, from motor (0) to joint (1)')
axes.set_ylabel('tension [N]')
axes.set_ylim(bottom=0.0)
axes.legend(frameon=False, fontsize=9)
