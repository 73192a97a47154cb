"""Backlash sizes of a real rig from its tensions alone."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

if TYPE_CHECKING:
    from endoscope_benchmarks.trials.real_recordings import RealRecording

TITLE = 'Real recordings: backlash size from tension alone'


def rows(settings: PapersBench) -> list[Row]:
    """A line through the others' sizes, and the shipped network; none without recordings."""
    from endoscope_benchmarks.trials.real_recordings import real_recordings
    from endoscope_benchmarks.trials.tension_loop import leave_one_out_errors

    recordings = real_recordings()
    if not recordings:
        settings.report('no recordings at hand; set ENDOSCOPE_SHARED')
        return []
    sizes = [float(np.rad2deg(recording.backlash_size)) for recording in recordings]
    errors = leave_one_out_errors([recording.tension_width for recording in recordings], sizes)
    note = 'errors of each: ' + ', '.join(f'{e:+.1f}' for e in errors)
    return [
        Row(
            'straight line through the other tubes: rms error [deg]',
            [float(np.sqrt(np.mean(errors**2)))],
            '3.4 (two features picked by hand)',
            at_most=3.4,
            note=note,
        ),
        _of_the_network(recordings),
    ]


def _of_the_network(recordings: 'Sequence[RealRecording]') -> Row:
    """The shipped network, which knows 90 deg where these tubes were moved by 60."""
    from endoscope_core.classifier.cnn_classifier import course
    from endoscope_core.classifier.weights_file import load_classifier
    from endoscope_core.signals import CALIBRATION_RATE, calibration_motion

    classifier, motion = load_classifier(), calibration_motion()
    phase = np.arange(motion.samples) / CALIBRATION_RATE
    errors, told = [], []
    for recording in recordings:
        wires = [np.interp(phase, recording.phase, wire) for wire in recording.tension.T]
        # One joint was moved: its two wires stand for those of both.
        judgement = classifier.judged(course(np.stack(2 * wires, axis=1)[None], motion.name))
        true, [size] = np.rad2deg(recording.backlash_size), np.rad2deg(judgement.size)
        errors.append(size - true)
        [reason] = classifier.reasons_to_refuse(judgement)
        told.append(
            f'tube of {recording.bend} deg: {true:.1f} deg, the network {size:.1f} deg'
            f'{", refused: " + reason if reason else ""}'
        )
    return Row(
        'the shipped 1D-CNN, trained on another motion: rms error [deg]',
        [float(np.sqrt(np.mean(np.square(errors))))],
        note='\n  '.join(told),
    )
