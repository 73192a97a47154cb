"""How long it takes from asking for a calibration to compensated motion."""

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

TITLE = 'Calibration, from request to compensated motion, s'


def rows(settings: PapersBench) -> list[Row]:
    """Rest, motion and way back as the calibration node commands them, and computing time."""
    import time

    import numpy as np

    from endoscope_benchmarks.trials.never_seen_tube import never_seen_tube
    from endoscope_core.classifier.classification import UnseenTensionError
    from endoscope_core.classifier.weights_file import load_classifier
    from endoscope_core.dataset import record_calibration
    from endoscope_core.identification.plant_fit import plants_of_calibration
    from endoscope_core.rig import shipped_rig
    from endoscope_core.signals import CALIBRATION_MOTIONS, calibration_motion

    # The motion is in the rig's time; what is computed (class, size and plant) is measured on this
    # machine, once for each tube.
    rest, gear = 0.5, shipped_rig().joints.gear
    found = []
    for name in CALIBRATION_MOTIONS:
        motion = calibration_motion(name)
        moving = rest + motion.signal.duration
        classifier = load_classifier(motion=name)
        judging, fitting = [], []
        for number in range(settings.tubes):
            tube = never_seen_tube(settings.seed, number)
            recording = record_calibration(tube.plant, tube.noise, motion)
            begin = time.perf_counter()
            try:
                classifier.classify(recording.tension)
            except UnseenTensionError as error:
                settings.report(f'{name}, tube {number + 1}: {error}')
            judging.append(time.perf_counter() - begin)
            begin = time.perf_counter()
            plants_of_calibration(recording.desired_angle, recording.tension, gear)
            fitting.append(time.perf_counter() - begin)
        brief = name != CALIBRATION_MOTIONS[0]
        found += [
            Row(
                f'{name}: class and size',
                (moving + np.array(judging)).tolist(),
                '' if brief else '< 11',
                at_most=5.0 if brief else 11.0,
            ),
            Row(
                f'{name}: class, size and plant',
                (moving + np.array(judging) + np.array(fitting)).tolist(),
                at_most=5.0 if brief else None,
            ),
            Row(f'{name}: of that, computing the plant', fitting),
        ]
    return found
