"""The rig is investigated from a page: motions are asked for, held by hand, a plant adopted."""

import json
import urllib.request

import pytest
from console_rig import ConsoleRig, ready

from endoscope_bags import open_bag
from endoscope_bags.event_bag import MARK, events_of
from endoscope_bags.metadata import METADATA
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_nodes.names import SLAVE_COMMAND

pytestmark = pytest.mark.engine

PLANT_NAME = 'described.yaml'


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    folder = tmp_path_factory.mktemp('investigated')
    (folder / 'bags').mkdir()
    save_plant(PlantDescription(), folder / 'bags' / PLANT_NAME)
    with ConsoleRig(folder) as rig:
        yield rig


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


def begin(rig, page, **words):
    answer = page.order('investigate', experiments=0, **words)
    assert answer['ok'], answer
    name = answer['investigation']
    rig.until(lambda: told(page, name)['running'], 'the investigation')
    return name


def told(page, name):
    known = {each['id']: each for each in page.state['investigations']}
    return known.get(name, {'running': False})


def question(rig, page, name):
    rig.until(lambda: told(page, name)['question'] or not told(page, name)['running'], 'a question')
    asked = told(page, name)['question']
    assert asked, told(page, name)
    return asked


def ended(rig, page, name):
    rig.until(lambda: not told(page, name)['running'], 'the end')
    return told(page, name)


def holds(rig, page, until):
    """Hold on, anew where a busy machine let go, until something has come true."""
    while not until():
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


def test_without_consent_nothing_moves_and_it_is_continued_later(running, page):
    rig = running
    name = begin(rig, page, plant=PLANT_NAME)
    asked = question(rig, page, name)
    assert asked['words'].startswith('Play this motion: Commissioning of bend_x and ')
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
    assert begin(rig, page, investigation=name) == name
    question(rig, page, name)
    assert page.order('stop', investigation=name)['ok']
    assert ended(rig, page, name)['goes_on']
    assert rig.client.state == 'DISABLED'
    assert not rig.wanted


def test_stop_pauses_what_is_played_and_leaves_everything_as_it_was(running, page):
    rig = running
    name = begin(rig, page, plant=PLANT_NAME)
    plays(rig, page, name)
    for op, words in (('record', {'on': True}), ('set', {'scale': 0.5}), ('adopt', {})):
        assert page.order(op, **words)['why'] == 'a motion of an investigation is under way'
    assert page.order('stop', investigation=name)['ok']
    it = ended(rig, page, name)
    assert rig.client.state == 'PAUSED'
    assert it['sentence'] == 'It was interrupted: a person ended it.'
    page.does(pressed=False)
    assert rig.stands()
    assert rig.setting('master.source') == 'master'
    assert rig.setting('compensator.mode') == 'bouc_wen'


def test_who_loses_the_controls_loses_what_is_played(running, page):
    rig = running
    name = begin(rig, page, plant=PLANT_NAME)
    plays(rig, page, name)
    assert page.order('release')['ok']
    ended(rig, page, name)
    assert rig.client.state == 'PAUSED'
    rig.until(lambda: 'console_web' not in rig.handle_senders(), 'a free place of the handle')


def test_one_is_played_explained_and_its_plant_adopted_and_undone(running, page):
    rig = running
    name = begin(rig, page, plant=PLANT_NAME)
    plays(rig, page, name)
    page.does(pressed=False)
    rig.until(lambda: not any(rig.clutches[-1:]), 'the release')
    rig.passes(0.5)
    assert rig.stands()
    holds(rig, page, lambda: not told(page, name)['plays'])
    page.does(pressed=False)
    assert rig.client.state == 'DISABLED'
    assert rig.setting('compensator.mode') == 'bouc_wen'

    # What the plant is good for is seen by a motion through either plant, held in the same way.
    plays(rig, page, name)
    assert page.state['adopted']['words'] != 'no plant has been adopted'
    holds(rig, page, lambda: not told(page, name)['plays'])
    page.does(pressed=False)
    assert rig.setting('compensator.mode') == 'bouc_wen'
    asked = question(rig, page, name)
    assert asked['words'].startswith('Play this motion: Held-out motion of bend_x and bend_y')
    assert page.order('consent', question=asked['id'], go=False)['ok']
    it = ended(rig, page, name)
    assert it['sentence'], it
    assert it['sentences'][-1] == 'Tracking was not measured: the motion was not wanted.'
    assert any(sentence.startswith('Explained in') for sentence in it['sentences'])
    with urllib.request.urlopen(rig.server.address + it['report']) as answer:
        assert 'Commissioning of bend_x' in answer.read().decode()
    folder = rig.folder / 'bags' / it['name']
    (only,) = json.loads((folder / 'log.json').read_text())['rounds']
    commands = open_bag(folder / only['bag']).joint_state(SLAVE_COMMAND)
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


def test_what_happened_is_kept_with_a_reason(running, page):
    answer = page.order('mark', reason='the wire has slipped')
    assert answer['ok'], answer
    path = running.folder / 'bags' / answer['why'].removeprefix('kept as ')
    running.until((path / METADATA).is_file, 'the bag')
    [event] = events_of(open_bag(path).metadata)
    assert (event.kind, event.reason) == (MARK, 'the wire has slipped')
