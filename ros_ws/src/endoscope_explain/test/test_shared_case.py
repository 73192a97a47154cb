"""A recording of the nominal plant that an independent program made, where there is one."""

import numpy as np
import pytest
from outside_data import CASES, needs

from endoscope_core.physics import load_plant
from endoscope_explain.fit.evidence import mean_squares
from endoscope_explain.fit.free_parameters import SCATTERED
from endoscope_explain.fit.nominal import with_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.options import BAND
from endoscope_explain.recording import recording_from_bag

FOLDER = CASES / 'sheath'
CASE = FOLDER / 'nominal.mcap'

pytestmark = needs(CASE)


def test_the_plant_as_described_leaves_the_noise_and_its_refit_stays_there():
    plant = load_plant(FOLDER / 'plant.yaml')
    recording = recording_from_bag(CASE, plant)
    _, references = with_references(recording, observe(recording, plant), plant, BAND, 1)
    for refitted, described in references:
        assert np.sqrt(mean_squares(refitted.model.observation, refitted.residuals).max()) < 1.5
        for item, coordinate, truth in zip(
            refitted.model.free, refitted.theta, described.theta, strict=True
        ):
            found, true = item.value(float(coordinate)), item.value(float(truth))
            if item.name in ('pretension', 'wire_stiffness', 'capstan_exponent'):
                assert found == pytest.approx(true, rel=0.02)
            elif item.name in SCATTERED:
                assert abs(found - true) < 0.5 * item.unit
