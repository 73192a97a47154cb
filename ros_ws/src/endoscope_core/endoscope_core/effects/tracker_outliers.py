"""`tracker_outliers`: isolated wrong samples of the tracker."""

from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'tracker_outliers',
    Stage.SENSING,
    physics='Isolated samples of the tracker are wrong.',
    equation='reading = q +- size_rad in a share `rate` of the samples, drawn by sample and seed',
    source='Tukey, A survey of sampling from contaminated distributions, 1960',
    parameters=(
        EffectParameter('rate', '-', 0.0, 0.5, 0.01, off=0.0),
        EffectParameter('size_rad', 'rad', 0.0, 3.0, 0.2, off=0.0),
    ),
)
