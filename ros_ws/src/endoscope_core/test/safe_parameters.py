"""Parameters of each hysteresis model that are safe to drive with."""

from endoscope_core.hysteresis import BoucWenParameters, DahlParameters

SAFE = {
    'bouc_wen': BoucWenParameters.from_shape(0.9, 0.5, 0.06, -0.9, 2.0),
    'dahl': DahlParameters(0.9, 0.5, 0.1, 1.6, -0.03),
}
