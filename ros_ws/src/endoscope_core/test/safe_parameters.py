"""Parameters of each hysteresis model that are safe to drive with."""

from endoscope_core.hysteresis import (
    AsymmetricBoucWenParameters,
    BoucWenParameters,
    DahlParameters,
    PlayParameters,
    PrandtlIshlinskiiParameters,
)

SAFE = {
    'bouc_wen': BoucWenParameters.from_shape(0.9, 0.5, 0.06, -0.9, 2.0),
    'asymmetric_bouc_wen': AsymmetricBoucWenParameters(
        0.9, 0.5, 0.1, 0.05, 0.08, -0.5, 2.0, 0.1, 0.3, 1.5
    ),
    'dahl': DahlParameters(0.9, 0.5, 0.1, 1.6, -0.03),
    'play': PlayParameters(0.9, 0.5, 0.05, 0.02),
    'prandtl_ishlinskii': PrandtlIshlinskiiParameters(
        (0.0, 0.2, 0.5, 0.8), (0.1, 0.3, 0.4, 0.2), 0.04
    ),
}
