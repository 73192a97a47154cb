"""The tutorial, followed literally, leads to the verdict and the numbers that it names."""

import json
from pathlib import Path

import numpy as np
import pytest
from doc_pages import WORKSPACE, run_page

from endoscope_bags import open_bag
from endoscope_core.physics import load_plant

pytestmark = pytest.mark.nightly

TUTORIAL = WORKSPACE / 'doc/tutorial.md'


@pytest.fixture(scope='module')
def followed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which every block of the tutorial has been run in its order."""
    folder = tmp_path_factory.mktemp('tutorial')
    run_page(TUTORIAL, folder)
    return folder


@pytest.mark.timeout(900)
def test_what_was_left_out_is_found(followed: Path) -> None:
    report = json.loads((followed / 'why/report.json').read_text())
    assert report['verdict'] == 'missing_physics'
    [effect] = report['effects']
    assert (effect['id'], effect['joint']) == ('stribeck_friction', 'bend_x')
    [added] = load_plant(followed / 'why/plant.yaml').effects
    assert added.parameters['rise'] == pytest.approx(0.6, abs=0.03)


def test_the_improved_plant_answers_as_the_rig_did(followed: Path) -> None:
    rig, guess, better = (
        open_bag(followed / name).joint_state('slave/measured_js').require('position')
        for name in ('my_rig', 'guess', 'better')
    )
    noise = np.deg2rad(0.25)
    assert np.std(better - rig) == pytest.approx(noise, rel=0.1)
    assert np.std(guess - rig) > 5.0 * noise
