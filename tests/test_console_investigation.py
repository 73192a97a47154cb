"""From a page: recordings are explained, the rig is investigated, motions held, a plant adopted."""

import json
import time
import urllib.request
from dataclasses import replace

import numpy as np
import pytest
from console_rig import PATIENCE_S, ConsoleRig, ready
from short_bags import PLANT, write_short_bag

from endoscope_bags import open_bag
from endoscope_console.explanations import EXPERIMENT_FILE, REPORT_FILE
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_core.signals.sampled_motion import write_command_file
from endoscope_explain.investigation.log import CALIBRATION, Round, Stop, begun
from endoscope_nodes.names import SLAVE_COMMAND

pytestmark = pytest.mark.engine

PLANT_NAME = 'described.yaml'
FAR = 0.06
AT = np.linspace(0.0, 2.0, 201)
BENDING = np.column_stack([0.2 * np.sin(AT), np.zeros(AT.size)])
"""An experiment of an earlier explanation."""


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    folder = tmp_path_factory.mktemp('investigated')
    bags = folder / 'bags'
    bags.mkdir()
    save_plant(PlantDescription(), bags / PLANT_NAME)
    interrupted(bags / 'interrupted', bags / PLANT_NAME)
    explained_earlier(bags)
    with ConsoleRig(folder) as rig:
        yield rig


def interrupted(folder, plant):
    """An investigation that was left once a rig as described had been calibrated."""
    log = begun(folder, plant)
    folder.mkdir()
    write_short_bag(folder / 'bag_1', PlantDescription(), duration=2.5)
    write_command_file(folder / 'motion_1.csv', np.array([0.0, 4.0]), 0.1 * np.eye(2))
    motion = Round(
        CALIBRATION, 'bend_x and bend_y', '', 'motion_1.csv', 4.0, 50.0, 'bag_1', recorded=True
    )
    words = 'It was interrupted.'
    replace(log, rounds=(motion,), stopped=Stop.INTERRUPTED, words=words).write(folder)


def explained_earlier(bags):
    """Two folders of explanations, of which one is broken."""
    earlier, broken = bags / 'why-it-stops', bags / 'why-not'
    for folder in (earlier, broken):
        folder.mkdir(parents=True)
        (folder / REPORT_FILE).write_text('<p>rivals')
    effects = [{'id': 'joint_stop', 'joint': 'bend_x'}]
    result = {'verdict': 'missing_physics', 'effects': effects, 'next_experiment': {'why': ''}}
    (earlier / 'report.json').write_text(json.dumps(result))
    (broken / 'report.json').write_text('{"verdict"')
    write_command_file(earlier / EXPERIMENT_FILE, AT, BENDING)


@pytest.fixture
def page(running):
    """Of the operator; the slave is limp, and has not been asked to move."""
    if running.client.state != 'DISABLED':
        running.client.ask('disable')
    running.wanted.clear()
    with running.page() as page:
        assert page.order('claim', take=True)['ok']
        yield page
        page.order('release')


def test_a_recording_is_explained_and_its_report_opens(running, page):
    rig, bags = running, running.folder / 'bags'
    write_short_bag(bags / 'sound.mcap', seed=2)
    save_plant(PLANT, bags / 'rig.yaml')
    assert 'sound.mcap' in [bag['name'] for bag in page.order('bags')['bags']]
    assert 'there is no recording' in page.order('explain', bag='../../etc/passwd')['why']
    begun = page.order('explain', bag='sound.mcap', plant='rig.yaml')
    assert begun['ok'], begun

    def entry():
        known = {each['id']: each for each in page.state.get('explanations', [])}
        return known.get(begun['explanation'], {'running': True})

    rig.until(lambda: not entry()['running'], 'the explanation')
    found = 'The described plant predicts the recording of bend_x.'
    assert entry()['sentence'] == found, entry()
    with urllib.request.urlopen(rig.server.address + entry()['report']) as answer:
        assert 'sandbox' in answer.headers['content-security-policy']
        assert found in answer.read().decode()
    assert not page.order('play', explanation=begun['explanation'])['ok']


def test_an_experiment_of_an_earlier_explanation_is_played_while_one_holds_on(running, page):
    rig = running
    ready(rig, page)
    entries = {each['bag']: each for each in page.state['explanations']}
    assert 'why-not/report.json' in entries['why-not']['error']
    assert entries['why-it-stops']['sentence'] == 'missing physics: joint_stop (bend_x)'
    with urllib.request.urlopen(rig.server.address + entries['why-it-stops']['report']) as answer:
        assert answer.read() == b'<p>rivals'
    answer = page.order('play', explanation=entries['why-it-stops']['id'])
    assert answer['ok'], answer
    rig.until(lambda: page.state['playing'] is not None, 'the experiment')
    assert rig.stands()
    rig.wanted.clear()
    holds(rig, page, lambda: rig.wanted and abs(rig.wanted[-1][0] - rig.wanted[0][0]) > FAR)
    page.does(pressed=False)
    rig.until(lambda: rig.clutches and rig.clutches[-1] == 0, 'clutch 0')
    assert rig.stands()
    holds(rig, page, lambda: page.state['playing'] is None)
    rig.until(lambda: rig.setting('master.source') == 'master', 'the end of it')
    assert not rig.setting('master.hold_to_play')
    assert rig.setting('master.command_file') == ''
    assert rig.wanted[-1] == pytest.approx(BENDING[-1], abs=0.005)


def begin(rig, page, **words):
    answer = page.order('investigate', experiments=0, **words)
    assert answer['ok'], answer
    name = answer['investigation']
    rig.until(lambda: investigation(page, name)['running'], 'the investigation')
    return name


def investigation(page, name):
    known = {each['id']: each for each in page.state['investigations']}
    return known.get(name, {'running': False})


def question(rig, page, name):
    rig.until(
        lambda: investigation(page, name)['question'] or not investigation(page, name)['running'],
        'a question',
    )
    asked = investigation(page, name)['question']
    assert asked, (investigation(page, name)['error'], investigation(page, name)['sentence'])
    return asked


def ended(rig, page, name):
    rig.until(lambda: not investigation(page, name)['running'], 'the end')
    return investigation(page, name)


def holds(rig, page, until):
    """Hold on, anew where a busy machine let go, until something has come true."""
    end = time.monotonic() + PATIENCE_S
    while not until():
        assert time.monotonic() < end, page.state
        if page.dead_man == 'READY':
            page.does(pressed=True)
        elif page.dead_man == 'OPEN' and page.hand.pressed:
            page.does(pressed=False)
        rig.passes(0.1)


def plays(rig, page, name):
    """Consent, enable, and hold on until the slave is moved."""
    assert page.order('consent', question=question(rig, page, name)['id'], go=True)['ok']
    rig.until(lambda: page.state['prepares'], 'its preparation')
    assert 'being prepared' in page.order('state', command='enable')['why']
    rig.until(lambda: not page.state['prepares'], 'the end of it')
    assert page.order('state', command='enable')['ok']
    rig.until(lambda: page.state['playing'] is not None, 'the motion')
    rig.wanted.clear()
    holds(rig, page, lambda: rig.wanted)


def test_without_consent_nothing_moves_and_who_loses_the_controls_loses_what_is_played(
    running, page
):
    rig = running
    name = begin(rig, page, plant=PLANT_NAME)
    asked = question(rig, page, name)
    assert asked['words'].startswith('Play this motion: Calibration of bend_x and ')
    assert asked['why'] == 'Nothing is known of the rig yet but its description.'
    refused = page.order('investigate', experiments=0)
    assert refused['why'] == 'the rig is being investigated'
    with rig.page() as other:
        assert 'operates' in other.order('consent', question=asked['id'], go=True)['why']
        assert 'operates' in other.order('stop', investigation=name)['why']
    assert page.order('consent', question=asked['id'], go=False)['ok']
    assert not page.order('consent', question=asked['id'], go=True)['ok']
    it = ended(rig, page, name)
    assert it['sentence'] == 'It was interrupted: the motion was not wanted.'
    assert (it['goes_on'], it['error']) == (True, None)
    assert rig.client.state == 'DISABLED'
    assert not rig.wanted

    assert begin(rig, page, investigation=name) == name
    plays(rig, page, name)
    for op, words in (('record', {'on': True}), ('set', {'scale': 0.5}), ('adopt', {})):
        assert page.order(op, **words)['why'] == 'a motion of an investigation is under way'
    assert page.order('release')['ok']
    assert ended(rig, page, name)['goes_on']
    assert rig.client.state == 'PAUSED'
    page.does(pressed=False)
    assert rig.stands()
    assert rig.setting('master.source') == 'master'
    assert rig.setting('compensator.mode') == 'bouc_wen'
    rig.until(lambda: 'console_web' not in rig.handle_senders(), 'a free place of the handle')


@pytest.mark.nightly
def test_one_is_explained_its_plant_shown_by_a_motion_and_adopted_and_undone(running, page):
    rig = running
    rig.until(lambda: page.state.get('investigations'), 'what was there before')
    name = begin(rig, page, investigation=page.state['investigations'][-1]['id'])
    # What the plant is good for is seen by a motion through either plant.
    plays(rig, page, name)
    page.does(pressed=False)
    rig.until(lambda: not any(rig.clutches[-1:]), 'the release')
    rig.passes(0.5)
    assert rig.stands()
    assert page.state['adopted']['words'] != 'no plant has been adopted'
    # The next motion may be asked for at once.
    holds(
        rig,
        page,
        lambda: investigation(page, name)['question'] or not investigation(page, name)['plays'],
    )
    page.does(pressed=False)
    assert rig.client.state == 'DISABLED'
    assert rig.setting('compensator.mode') == 'bouc_wen'
    asked = question(rig, page, name)
    assert asked['words'].startswith('Play this motion: Held-out motion of bend_x and bend_y')
    assert page.order('consent', question=asked['id'], go=False)['ok']
    it = ended(rig, page, name)
    assert it['sentence'], it
    assert it['sentences'][-1] == 'Tracking was not measured: the motion was not wanted.'
    assert any(sentence.startswith('Explained in') for sentence in it['sentences'])
    with urllib.request.urlopen(rig.server.address + it['report']) as answer:
        assert 'Calibration of bend_x' in answer.read().decode()
    played = rig.folder / 'bags' / it['name'] / 'tracking_described_1'
    commands = open_bag(played).joint_state(SLAVE_COMMAND)
    assert abs(commands.select(['bend_x']).require('position')).max() > 0.1

    assert page.order('adopt', plant=it['improved'])['code'] == 'no_session'
    ready(rig, page)
    answer = page.order('adopt', plant=it['improved'])
    assert answer['ok'], answer
    rig.until(lambda: page.state['adopted']['undo'], 'the plant')
    assert page.state['adopted']['words'] in answer['why']
    answer = page.order('adopt')
    assert answer['why'] == 'undone: no plant has been adopted', answer
    assert page.order('adopt')['code'] == 'nothing_to_undo'
    assert 'there is no plant' in page.order('adopt', plant='../../etc/passwd')['why']
