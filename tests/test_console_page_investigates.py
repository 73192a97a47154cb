"""The page of the console in a real browser: keep, investigate, adopt and undo."""

import json
import re

import pytest
from browsed_console import BrowsedConsole, grip, hold_enable, shows, take, until
from playwright.sync_api import expect

from endoscope_bags import open_bag
from endoscope_bags.event_bag import MARK, events_of
from endoscope_bags.metadata import METADATA
from endoscope_core.physics import PlantDescription, save_plant

pytestmark = pytest.mark.engine

FAR = 0.03
"""rad at a motor's shaft that no noise makes."""
WHY = 'Why: Nothing is known of the rig yet but its description.'


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    folder = tmp_path_factory.mktemp('investigated')
    earlier = folder / 'why-it-lags'
    earlier.mkdir()
    result = {'verdict': 'parameters_differ', 'effects': [], 'next_experiment': None}
    (earlier / 'report.json').write_text(json.dumps(result))
    save_plant(PlantDescription(), earlier / 'plant.yaml')
    with BrowsedConsole(folder) as console:
        yield console


@pytest.fixture
def page(running, browser):
    """The slave is limp, and the page has the controls."""
    running.ask(lambda graph: graph.command('disable'))
    with running.page(browser, viewport={'width': 1024, 'height': 768}) as page:
        take(page)
        yield page


def test_what_happened_is_kept_with_a_reason(running, page):
    page.fill('#mark-reason', 'the wire has slipped')
    page.click('#mark')
    shows(page, 'answer', re.compile(r'^Keep: done, kept as mark-\d+-\d+Z$'))
    [path] = running.folder.glob('mark-*')
    until(page, (path / METADATA).is_file, 'the bag')
    [event] = events_of(open_bag(path).metadata)
    assert (event.kind, event.reason) == (MARK, 'the wire has slipped')
    expect(page.locator('#mark-reason')).to_have_value('')


def card(page):
    return page.locator('#investigations li').first


def test_an_investigation_asks_plays_under_the_hand_and_stops(running, page):
    begin = running.now_ns
    page.click('#tab-explain')
    page.click('#investigate')
    dialog = page.locator('#consent')
    expect(dialog).to_be_visible()
    shows(page, 'consent-words', re.compile('^Play this motion: Calibration of bend_x and bend'))
    shows(page, 'consent-why', WHY)
    page.keyboard.press('Escape')
    expect(dialog).to_be_hidden()
    expect(card(page)).to_contain_text('It was interrupted: the motion was not wanted.')
    expect(page.locator('#report iframe')).to_be_visible()
    assert running.moved(begin) == 0.0

    go_on = card(page).get_by_role('button', name='Continue')

    def may_go_on():
        # A machine that stood still for 2 s has lost him the controls.
        if page.locator('#operator').inner_text() != 'you':
            page.click('#tab-operate')
            take(page)
            page.click('#tab-explain')
        return go_on.is_enabled()

    until(page, may_go_on, 'Continue')
    go_on.click()
    expect(dialog).to_be_visible()
    page.click('#consent [value=go]')
    expect(page.locator('#tab-operate')).to_have_attribute('aria-selected', 'true')
    hold_enable(page)
    begin = running.now_ns
    grip(
        page,
        lambda: page.keyboard.down('Space'),
        lambda: page.keyboard.up('Space'),
        lambda: running.moved(begin) > FAR,
    )
    shows(page, 'next', re.compile(r'^Playing the experiment, \d+ % done'))
    page.keyboard.up('Space')
    assert running.stands(page)
    page.click('#tab-explain')
    card(page).get_by_role('button', name='Stop').click()
    shows(page, 'state', 'PAUSED')
    expect(card(page)).to_contain_text('It was interrupted: a person ended it.')
    expect(card(page).get_by_role('button', name='Continue')).to_be_enabled()


@pytest.mark.nightly
def test_a_plant_is_adopted_and_undone(page):
    page.click('#tab-explain')
    in_force = page.locator('#in-force p')
    expect(in_force).to_have_text('no plant has been adopted')
    expect(page.locator('#undo')).to_be_disabled()
    adopt = page.locator('#explanations li').get_by_role('button', name='Adopt the plant')
    adopt.click()
    shows(page, 'adopt-answer', re.compile(r'^Refused \(no session\): no motion session is open'))
    page.click('#tab-operate')
    hold_enable(page)
    page.click('#tab-explain')
    adopt.click()
    expect(in_force).to_have_text(re.compile(r'^plant \w+ adopted$'))
    page.click('#undo')
    expect(in_force).to_have_text('no plant has been adopted')
    shows(page, 'adopt-answer', 'undone: no plant has been adopted')


@pytest.mark.nightly
def test_all_of_it_can_be_reached(running, browser):
    for width, height in ((1440, 900), (1024, 768)):
        with running.page(browser, viewport={'width': width, 'height': height}) as page:
            expect(page.locator('#keep')).to_be_in_viewport(ratio=1)
            page.click('#tab-explain')
            expect(page.locator('#investigate')).to_be_in_viewport(ratio=1)
            page.locator('#explanations li').last.scroll_into_view_if_needed()
            expect(page.locator('#explanations li').last).to_be_in_viewport()
