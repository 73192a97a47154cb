"""Physical states of a simulated joint that a missing term may depend on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from endoscope_core.physics.layout import (
    IN_OTHER_JOINT,
    JOINT_RADIUS,
    OUT_EFFORT,
    OUT_JOINT,
    OUT_MOTOR,
    OUT_MOTOR_SPEED,
    OUT_TENSION_A,
    OUT_TENSION_B,
    PULLEY_RADIUS,
)
from endoscope_explain.observation import TICK, JointObservation

Array = NDArray[np.float64]

STATE_NAMES = {
    't': 'time since the first command, s',
    'q': 'bending angle, rad',
    'dq': 'bending speed, rad/s',
    'm': 'motor angle, as the bending of a wire without stretch, rad',
    'dm': 'motor speed, as that of a wire without stretch, rad/s',
    'v': 'sliding speed of the wire, m/s',
    'T': 'mean tension at the load cells, N',
    'tau': 'motor torque, N m',
    'q_other': 'bending angle of the other joint, rad',
    'dwell': 'logarithm of one plus the last rest in units of 0.1 s, fading over 0.02 rad',
    'lag_q': 'bending angle minus its mean over the last second, rad',
    'lag_T': 'mean tension minus its mean over the last second, N',
}
RESTING_RAD_PER_S = 0.02
FADING_RAD = 0.02
LAG_S = 1.0


@dataclass(frozen=True)
class JointStates:
    """States (N,) of one joint on 1 ms ticks, by the names in `STATE_NAMES`."""

    values: dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        """Return one state (N,)."""
        return self.values[name]


def joint_states(observation: JointObservation, parameters: Array, outputs: Array) -> JointStates:
    """States along a simulation.

    Parameters
    ----------
    observation : JointObservation
    parameters : array (parameters,)
        Packed.
    outputs : array (N, OUTPUTS)
    """
    q = outputs[:, OUT_JOINT]
    dq: Array = np.asarray(np.gradient(q, TICK), dtype=float)
    rigid = parameters[PULLEY_RADIUS] / parameters[JOINT_RADIUS]
    dm = rigid * outputs[:, OUT_MOTOR_SPEED]
    tension = 0.5 * (outputs[:, OUT_TENSION_A] + outputs[:, OUT_TENSION_B])
    return JointStates(
        {
            't': np.asarray(TICK * np.arange(len(q)), dtype=float),
            'q': q,
            'dq': dq,
            'm': rigid * outputs[:, OUT_MOTOR],
            'dm': dm,
            'v': 0.5 * parameters[JOINT_RADIUS] * (dm + dq),
            'T': tension,
            'tau': outputs[:, OUT_EFFORT],
            'q_other': observation.inputs[0, :, IN_OTHER_JOINT],
            'dwell': _dwell(dq),
            'lag_q': _above_lag(q),
            'lag_T': _above_lag(tension),
        }
    )


def _above_lag(values: Array) -> Array:
    share = TICK / LAG_S
    slow, _ = lfilter([share], [1.0, share - 1.0], values - values[0], zi=[0.0])
    return np.asarray(values - values[0] - slow)


def _dwell(speed: Array) -> Array:
    """Memory of the last rest, fading with the angle travelled since."""
    moving = np.abs(speed) > RESTING_RAD_PER_S
    begins = np.flatnonzero(np.diff(np.r_[False, moving].astype(int)) == 1)
    ends = np.flatnonzero(np.diff(np.r_[moving, False].astype(int)) == -1)
    result = np.zeros(len(speed))
    rest_from = 0
    for begin, end in zip(begins, ends, strict=True):
        rest = TICK * (begin - rest_from)
        travelled = np.cumsum(np.abs(speed[begin : end + 1])) * TICK
        result[begin : end + 1] = np.log1p(rest / 0.1) * np.exp(-travelled / FADING_RAD)
        rest_from = int(end) + 1
    return result
