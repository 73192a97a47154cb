"""`clock_skew`: the tracker's clock runs fast or slow against the rest."""

from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'clock_skew',
    Stage.RECORDING,
    physics="The tracker's clock runs fast or slow against the other devices'.",
    equation='stamp = start + (1 + skew) (t - start)',
    source='Moon, Skelly, Towsley, IEEE INFOCOM 1999',
    parameters=(
        EffectParameter(
            'skew', '-', -0.05, 0.05, 1e-3, off=0.0, starts=(-5e-4, 5e-4), comparable=True
        ),
    ),
)
