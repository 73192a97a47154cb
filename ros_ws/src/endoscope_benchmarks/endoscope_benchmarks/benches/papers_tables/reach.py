"""How far a tube lets the tip be bent, as a calibration tells it."""

import numpy as np

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

TITLE = 'Reach told by the 9 s calibration, to both sides, % off the true one'
_TUBES = 20
_LARGEST = 5.0


def rows(settings: PapersBench) -> list[Row]:
    """Random rigs in random tubes of the family, both joints."""
    from endoscope_benchmarks.trials.classifier_trial import random_tube
    from endoscope_core.control import reach
    from endoscope_core.dataset import record_calibration
    from endoscope_core.identification.plant_fit import plants_of_calibration
    from endoscope_core.rig import shipped_rig

    errors = []
    for number in range(_TUBES):
        generator = np.random.default_rng([settings.seed, number])
        plant = random_tube(generator)
        recording = record_calibration(plant, int(generator.integers(2**31)))
        found = plants_of_calibration(
            recording.desired_angle, recording.tension, shipped_rig().joints.gear
        )
        for joint, told in zip(plant.joints.values(), found, strict=True):
            true, guess = reach(joint), reach(told.joint)
            errors.append(100.0 * abs((guess.high - guess.low) / (true.high - true.low) - 1.0))
        settings.report(f'reach: tube {number + 1} of {_TUBES}')
    return [
        Row('off', errors, digits=1),
        Row('largest', [max(errors)], at_most=_LARGEST, digits=1),
    ]
