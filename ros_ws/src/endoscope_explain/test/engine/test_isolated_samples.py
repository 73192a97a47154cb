"""Wrong tracker samples that only a simulation shows."""

from dataclasses import replace

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.fit.model import packed_joint
from endoscope_explain.fit.nominal import all_references, with_isolated_marked, without_isolated
from endoscope_explain.observe.observation import observe

PLANT = PlantDescription()
SPIKES = [40, 44, 159]


def spiked(recording, known):
    """Samples off by 10 deg in motion, and the last one; the audit found one elsewhere, or none."""
    bending = recording.bending
    values = bending.values.copy()
    values[SPIKES, 0] += np.deg2rad(10.0)
    valid = bending.valid.copy()
    valid[80, :] = not known
    return recording.with_series({'bending': replace(bending, values=values, valid=valid)})


def cleaned(recording, plant):
    observations = observe(recording, PLANT)
    packed = {o.joint: packed_joint(plant, o.joint) for o in observations}
    fits = tuple(fitted for fitted, _ in all_references(observations, packed, 1))
    return observations, without_isolated(recording, observations, fits)


def test_spikes_are_left_out_where_some_samples_were_wrong_already(record):
    recording = spiked(record(duration=4.0), known=True)
    before, after = cleaned(recording, PLANT)
    lost = np.setdiff1d(before[0].channels[-1].time, after[0].channels[-1].time)
    stamps = recording.bending.time - recording.command.time[0]
    np.testing.assert_allclose(lost, stamps[SPIKES], atol=1e-9)


def test_without_a_known_wrong_sample_a_spike_may_be_physics(record):
    before, after = cleaned(spiked(record(duration=4.0), known=False), PLANT)
    assert after is before


def test_a_second_recording_is_judged_without_what_sticks_out_of_the_prediction(record):
    recording = spiked(record(duration=4.0), known=True)
    judged = with_isolated_marked(recording, PLANT)
    marked = np.argwhere(judged.bending.valid != recording.bending.valid)
    np.testing.assert_array_equal(marked, [[spike, 0] for spike in SPIKES])
    untouched = spiked(record(duration=4.0), known=False)
    assert with_isolated_marked(untouched, PLANT) is untouched
