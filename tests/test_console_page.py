"""The page of the console in a real browser: each button, each kind of hand, what ends a grip.

Eight journeys for every change; the others are tried at night.
"""

import re

import pytest
from browsed_console import (
    BrowsedConsole,
    enable,
    grip,
    hold,
    hold_enable,
    shows,
    take,
    until,
)
from playwright.sync_api import expect

SHARE = "(button) => Number(button.style.getPropertyValue('--share'))"
# Longer than a button has to be held.
HELD_MS = 1500
FAR = 0.03
"""rad at a motor's shaft that no noise makes."""
FOLLOWING = "document.getElementById('lamp').textContent === 'FOLLOWING'"
GAMEPAD = """
window.pad = { connected: true, mapping: 'standard', index: 0, id: 'made up', axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
window.plugged = true;
Navigator.prototype.getGamepads = () => [window.plugged ? window.pad : null];
"""
REPEATS = """
Object.defineProperty(WebSocket.prototype, 'onmessage', { set(take) {
  this.addEventListener('message', ({ data }) => {
    if (String(data).includes('"ENGAGED"')) window.saidAgain = () => take({ data });
    take({ data });
  });
} });
"""

OUTSIDE = """() => {
  const sought = 'button, input, select, h1, dd, canvas, .touch, #next, figcaption';
  return [...document.querySelectorAll(sought)].filter((element) => {
    const { width, left, top, right, bottom } = element.getBoundingClientRect();
    const across = left >= 0 && right <= innerWidth + 0.5;
    const inside = across && top >= 0 && bottom <= innerHeight + 0.5;
    return element.checkVisibility() && !element.closest('dialog') && width > 0 && !inside;
  }).map((element) => element.id || element.className || element.outerHTML.slice(0, 80));
}"""
NAMELESS = """() => {
  const named = (element) => element.textContent.trim() || element.getAttribute('aria-label')
    || element.labels?.length || element.closest('[role=img]');
  return [...document.querySelectorAll('button, input, select, canvas, .touch')]
    .filter((element) => !named(element)).map((element) => element.outerHTML);
}"""
SIZES = """() => Object.fromEntries([...document.querySelectorAll('body *')]
  .filter((element) => element.checkVisibility())
  .map((element) => [element.id || element.tagName, getComputedStyle(element).fontSize])
  .map(([name, size]) => [name, parseFloat(size)]))
"""
CUT = """() => {
  const sought = 'button, input, select, h1, dd, canvas, .touch, #next, figcaption';
  return [...document.querySelectorAll(sought)].filter((element) => {
    if (!element.checkVisibility() || element.closest('dialog')) return false;
    element.scrollIntoView({ block: element.closest('.bar, #view') ? 'nearest' : 'end' });
    const box = element.getBoundingClientRect();
    for (let outer = element.parentElement; outer; outer = outer.parentElement) {
      if (getComputedStyle(outer).overflow === 'visible') continue;
      const { left, top, right, bottom } = outer.getBoundingClientRect();
      const across = box.left >= left - 1 && box.right <= right + 1;
      if (!across || box.top < top - 1 || box.bottom > bottom + 1) return true;
    }
    const across = box.width > 0 && box.left >= 0 && box.right <= innerWidth + 1;
    return !across || box.top < 0 || box.bottom > innerHeight + 1;
  }).map((element) => element.id || element.className || element.outerHTML.slice(0, 80));
}"""
WHITE = 'rgb(242, 244, 248)'
ANIMATION = """() => {
  const alarm = document.createElement('div');
  alarm.className = 'alarm high';
  document.body.append(alarm);
  return getComputedStyle(alarm).animationName;
}"""


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    with BrowsedConsole(tmp_path_factory.mktemp('browsed')) as console:
        yield console


@pytest.fixture
def console(running):
    """Nobody operates, and the slave is limp."""
    running.ask(lambda graph: graph.command('disable'))
    return running


@pytest.fixture
def page(console, browser):
    """Without plots, which a busy machine draws too slowly for a hand to be trusted."""
    with console.page(browser, viewport={'width': 1024, 'height': 768}) as page:
        yield page


def follows(console, page, begin):
    """Whether the slave is moved by a hand."""
    return lambda: console.moved(begin) > FAR and page.evaluate(FOLLOWING)


def leaves(console, page, begin, script):
    """Whether it has followed, and a script was run in that very turn of the page."""
    # A stall of the machine may end a grip between two.
    moved = follows(console, page, begin)
    leave = f'(() => {{ const held = {FOLLOWING}; if (held) {{ {script}; }} return held; }})()'
    return lambda: moved() and page.evaluate(leave)


def press_keys(page, *keys):
    def press():
        for key in keys:
            page.keyboard.down(key)

    def release():
        for key in reversed(keys):
            page.keyboard.up(key)

    return press, release


def test_a_stranger_is_led_to_the_first_motion(console, browser):
    with console.page(browser) as page:
        lead(console, page)


def lead(console, page):
    shows(page, 'next', 'Take the controls. Nothing moves yet.')
    shows(page, 'operator', 'nobody')
    for name in ('enable', 'home', 'disable', 'calibrate', 'compensator'):
        expect(page.locator(f'#{name}')).to_be_disabled()
    # Whoever may operate may end motion, always.
    expect(page.locator('#pause')).to_be_enabled()
    page.get_by_role('button', name='Take the controls').click()
    shows(page, 'next', re.compile('^Hold Enable for 1 s'))
    hold_enable(page)
    shows(page, 'next', re.compile('^Hold Calibrate for 1 s.* hold Space and an arrow key'))
    begin = console.now_ns
    press, release = press_keys(page, 'Space', 'ArrowRight')
    grip(page, press, release, follows(console, page, begin))
    release()
    shows(page, 'lamp', 'OPEN')
    assert console.stands(page)
    actual = page.locator('#plots [data-value]').nth(1)
    assert abs(float(actual.inner_text())) < 100.0, 'the plots show where it is, in deg'


def test_keys_hold_and_a_release_ends_it(console, page):
    enable(page)
    begin = console.now_ns
    press, release = press_keys(page, 'Shift', 'Space', 'KeyA')
    grip(page, press, release, follows(console, page, begin))
    page.keyboard.up('Space')
    shows(page, 'lamp', 'OPEN')
    assert console.stands(page), 'an arrow that is still down moves nothing'
    release()


@pytest.mark.nightly
def test_a_mouse_on_the_pad_holds_and_drags(console, page):
    enable(page)
    box = page.locator('#pad').bounding_box()
    middle = box['x'] + box['width'] / 2, box['y'] + box['height'] / 2
    begin = console.now_ns

    def press():
        page.mouse.move(*middle)
        page.mouse.down()
        for k in range(20):
            page.mouse.move(middle[0] + 5 * k, middle[1] - 2 * k)
            page.wait_for_timeout(20)

    def dragged():
        shown = page.locator('#pad').get_attribute('data-on')
        return console.moved(begin) > FAR and shown in ('following', 'spent')

    grip(page, press, page.mouse.up, dragged)
    page.mouse.up()
    shows(page, 'lamp', 'OPEN')
    assert console.stands(page)
    page.mouse.move(*middle)
    assert console.stands(page), 'a mouse that hovers moves nothing'


@pytest.mark.nightly
def test_fingers_hold_by_both_areas_together(console, browser):
    how = {'viewport': {'width': 1024, 'height': 768}, 'has_touch': True}
    with console.page(browser, **how) as page:
        enable(page)
        devtools = page.context.new_cdp_session(page)
        boxes = [page.locator(name).bounding_box() for name in ('#thumb', '#pad')]
        assert boxes[0]['width'] >= 96
        assert boxes[0]['height'] >= 96
        assert boxes[0]['x'] < 512 < boxes[1]['x']
        thumb, pad = ({'x': b['x'] + 60, 'y': b['y'] + 60, 'id': k} for k, b in enumerate(boxes))

        def touch(kind, *points):
            devtools.send('Input.dispatchTouchEvent', {'type': kind, 'touchPoints': list(points)})

        begin = console.now_ns
        touch('touchStart', pad)
        shows(page, 'next', re.compile('One finger is down'))
        touch('touchMove', {**pad, 'x': pad['x'] + 80})
        assert console.moved(begin) < 1e-9
        touch('touchEnd')

        def press():
            touch('touchStart', thumb)
            touch('touchStart', thumb, pad)
            for k in range(20):
                touch('touchMove', thumb, {**pad, 'x': pad['x'] + 6 * k})
                page.wait_for_timeout(20)

        grip(page, press, lambda: touch('touchEnd'), lambda: console.moved(begin) > FAR)
        touch('touchEnd', pad)
        shows(page, 'lamp', 'OPEN')
        touch('touchEnd')
        assert console.stands(page)


@pytest.mark.nightly
def test_a_gamepad_holds_and_lets_go_when_unplugged(console, browser):
    with console.page(browser, script=GAMEPAD) as page:
        take(page)
        expect(page.locator('#enable')).to_be_enabled()
        page.evaluate('pad.buttons[9].pressed = true')
        shows(page, 'state', 'ENABLED')
        page.keyboard.press('Escape')
        shows(page, 'state', 'PAUSED')
        page.wait_for_timeout(HELD_MS)
        shows(page, 'state', 'PAUSED')
        page.evaluate('pad.buttons[9].pressed = false')
        hold_enable(page)
        begin = console.now_ns
        press, release = (
            lambda on=on: page.evaluate(f'pad.buttons[5].pressed = {on} === 1; pad.axes[0] = {on}')
            for on in (1, 0)
        )
        unplug = "plugged = false; dispatchEvent(new Event('gamepaddisconnected'))"
        grip(page, press, release, leaves(console, page, begin, unplug))
        shows(page, 'lamp', 'OPEN')
        shows(page, 'lamp-why', 'the gamepad was unplugged')
        expect(page.locator('#alarms')).to_contain_text('The gamepad is gone.')
        page.evaluate('plugged = true')
        assert console.stands(page), 'it comes back with its button down'
        release()
        page.evaluate('pad.buttons[3].pressed = true')
        expect(page.locator('#device')).to_contain_text('position')
        page.evaluate('pad.buttons[8].pressed = true')
        shows(page, 'state', 'PAUSED')


@pytest.mark.parametrize(
    ('script', 'reason'),
    [
        ("dispatchEvent(new Event('blur'))", 'this page is not in front'),
        ("document.getElementById('tab-see').click()", 'the section is out of sight'),
    ],
    ids=['blur', 'tab'],
)
def test_what_takes_the_page_away_lets_go_at_once(console, page, script, reason):
    enable(page)
    begin = console.now_ns
    press, release = press_keys(page, 'Space', 'ArrowLeft')
    grip(page, press, release, leaves(console, page, begin, script))
    shows(page, 'lamp', 'OPEN')
    shows(page, 'lamp-why', reason)
    page.evaluate("dispatchEvent(new Event('focus'))")
    page.keyboard.down('Space')
    assert console.stands(page), 'a key that is held all along does not engage again'
    release()


@pytest.mark.nightly
def test_what_the_server_said_before_it_heard_hides_no_reason(console, browser):
    with console.page(browser, script=REPEATS) as page:
        enable(page)
        begin = console.now_ns
        press, release = press_keys(page, 'Space', 'ArrowLeft')
        freeze = "document.dispatchEvent(new Event('freeze')); saidAgain()"
        grip(page, press, release, leaves(console, page, begin, freeze))
        shows(page, 'lamp', 'OPEN')
        shows(page, 'lamp-why', 'this page was frozen')
        release()


def test_of_two_pages_the_one_that_takes_over_has_the_controls(console, browser, page):
    enable(page)
    with console.page(browser) as other:
        expect(other.locator('#claim')).to_have_text('Take over …')
        other.click('#pause')
        shows(page, 'state', 'PAUSED')
        hold_enable(page)
        other.click('#claim')
        expect(other.locator('#take')).to_be_visible()
        other.get_by_role('button', name='Leave it').click()
        shows(page, 'operator', 'you')
        # Two pages that draw at once may leave the one who holds blind on a busy machine.
        other.click('#tab-see')
        begin = console.now_ns
        press, release = press_keys(page, 'Space', 'ArrowRight')
        grip(page, press, release, follows(console, page, begin))
        other.click('#tab-operate')
        other.click('#claim')
        other.get_by_role('button', name='Take over', exact=True).click()
        shows(other, 'operator', 'you')
        expect(page.locator('#answer')).to_contain_text('The controls are lost')
        expect(page.locator('#alarms')).to_contain_text('took the controls')
        expect(other.locator('#alarms')).not_to_contain_text('took the controls')
        expect(page.locator('#operator')).not_to_have_text('you')
        assert console.stands(page), 'the one who lost them still presses'
        release()
        other.click('#claim')
        shows(other, 'operator', 'nobody')


@pytest.mark.nightly
def test_whoever_looks_on_can_do_nothing(console, browser, page):
    with console.page(browser, token=console.viewer) as viewer:
        shows(viewer, 'next', 'You are looking on. To operate, open the operator’s address.')
        expect(viewer.locator('#age')).to_contain_text('ms')
        expect(viewer.locator('#claim')).to_be_disabled()
        expect(viewer.locator('#claim')).not_to_have_css('background-color', WHITE)
        viewer.keyboard.press('Escape')
        viewer.click('#tab-explain')
        expect(viewer.locator('#ask-go')).to_be_disabled()


def test_pause_is_always_live_for_who_operates(console, page):
    enable(page)
    page.click('#pause')
    shows(page, 'state', 'PAUSED')
    shows(page, 'next', re.compile('^Paused, position held. Hold Resume'))
    hold_enable(page)
    page.click('#tab-see')
    page.keyboard.press('Escape')
    shows(page, 'state', 'PAUSED')
    page.click('#tab-operate')
    page.keyboard.down('KeyE')
    shows(page, 'state', 'ENABLED')
    page.keyboard.up('KeyE')
    page.click('#disable')
    shows(page, 'state', 'DISABLED')


@pytest.mark.nightly
def test_a_button_that_is_not_held_for_a_second_does_nothing(console, page):
    take(page)
    page.keyboard.down('KeyE')
    page.wait_for_timeout(300)
    page.keyboard.up('KeyE')
    page.locator('#enable').click()
    page.focus('#enable')
    page.keyboard.press('Enter')
    page.wait_for_timeout(1500)
    shows(page, 'state', 'DISABLED')


def test_home_calibration_and_compensation(console, page):
    enable(page)
    begin = console.now_ns
    press, release = press_keys(page, 'Space', 'ArrowDown')
    grip(page, press, release, follows(console, page, begin))
    release()
    page.keyboard.down('KeyH')
    expect(page.locator('#answer')).to_contain_text('Home: done')
    page.keyboard.up('KeyH')
    hold(page, 'calibrate')
    expect(page.locator('#calibration-progress')).to_be_visible()
    shows(page, 'next', re.compile('^Calibrating'))
    shows(page, 'class', re.compile(r'^\d+° \(\d+ %\)$'))
    shows(page, 'size', re.compile(r'^\d+\.\d°$'))
    shows(page, 'interval', re.compile(r'^\d+\.\d° and \d+\.\d°$'))
    expect(page.locator('#answer')).to_contain_text('physical now, and was bouc_wen')
    expect(page.locator('#compensator')).to_have_value('physical')
    expect(page.locator('#compensator-in-force')).to_be_empty()
    shows(page, 'next', re.compile('^Hold Space and press an arrow key.* Or hold Home'))
    hold(page, 'home')
    shows(page, 'next', re.compile('^Hold Space and press an arrow key, or drag on the pad.$'))

    def compensation():
        node = console.graph.nodes['compensator']
        return [node.get_parameter(name).value for name in ('mode', 'selected_by')]

    assert console.ask(lambda _: compensation()) == ['physical', 'plant']
    page.select_option('#compensator', 'bouc_wen')
    expect(page.locator('#answer')).to_contain_text('compensator: done')
    assert console.ask(lambda _: compensation()) == ['bouc_wen', 'class']
    page.select_option('#compensator', 'none')
    expect(page.locator('#alarms')).to_contain_text('nothing is compensated')


@pytest.mark.nightly
def test_scale_and_mode_change_only_while_nothing_is_held(console, page):
    enable(page)

    def scale():
        return console.ask(lambda graph: graph.nodes['master'].get_parameter('scale').value)

    console.ask(lambda graph: graph.set('master', scale=1.0))
    shows(page, 'scale-value', '1')
    page.keyboard.press('BracketLeft')
    until(page, lambda: scale() == 0.7, 'a smaller scale')
    page.keyboard.press('BracketRight')
    until(page, lambda: scale() == 1.0, 'a larger scale')
    page.locator('#scale').fill('3')
    until(page, lambda: scale() == 0.5, 'the scale of the slider')
    page.keyboard.press('KeyM')
    expect(page.locator('#mode-speed')).to_have_attribute('aria-pressed', 'true')
    page.click('#mode-position')
    expect(page.locator('#mode-position')).to_have_attribute('aria-pressed', 'true')
    begin = console.now_ns
    press, release = press_keys(page, 'Space', 'ArrowUp')
    grip(page, press, release, follows(console, page, begin))
    expect(page.locator('#scale')).to_be_disabled()
    page.keyboard.press('KeyM')
    expect(page.locator('#mode-position')).to_have_attribute('aria-pressed', 'true')
    release()
    console.ask(lambda graph: graph.set('master', scale=1.0))


def test_recordings_are_made_and_offered_for_explanation(console, page):
    page.click('#tab-explain')
    expect(page.locator('#ask-go')).to_be_disabled()
    expect(page.locator('#ask-why')).to_contain_text('There is no recording yet')
    expect(page.locator('#investigate')).to_be_disabled()
    expect(page.locator('#investigate-why')).to_contain_text('take the controls')
    page.click('#tab-operate')
    take(page)
    page.click('#record')
    shows(page, 'record', 'Stop recording')
    expect(page.locator('#recorder')).to_contain_text('bag')
    page.wait_for_timeout(500)
    page.click('#tab-explain')
    expect(page.locator('#being-recorded')).to_contain_text('is being recorded')
    expect(page.locator('#asking')).not_to_contain_text('There is no recording yet')
    expect(page.locator('#plant')).to_have_attribute(
        'placeholder', "this graph's own: nominal_plant"
    )
    page.click('#stop-and-explain')
    expect(page.locator('#explanations li')).to_have_count(1)
    expect(page.locator('#explanations li')).to_contain_text('by nominal_plant')
    expect(page.locator('#being-recorded')).to_be_hidden()
    expect(page.locator('#bag option')).to_have_count(1)
    cancel = page.get_by_role('button', name='Cancel')
    cancel.click()
    expect(cancel).to_be_hidden()
    # Nobody types an order into a field.
    page.fill('#plant', 'ehcm')
    page.keyboard.press('Space')
    shows(page, 'state', 'DISABLED')


@pytest.mark.nightly
def test_every_node_is_seen_with_its_health(console, page):
    page.click('#tab-see')
    for node in console.ask(
        lambda graph: sorted({name.split(':')[0] for name in graph.diagnostics})
    ):
        row = page.locator('#nodes tr', has=page.get_by_text(node, exact=True))
        expect(row).to_have_count(1)
        expect(row.locator('.health')).to_have_text(re.compile('ok|warning|error'))
    expect(page.locator('#states li').last).to_contain_text('DISABLED')
    expect(page.locator('#counters')).to_contain_text('pictures')
    expect(page.locator('#clients')).to_contain_text('this page')


@pytest.mark.nightly
def test_pause_ends_what_is_held_to_resume(console, page):
    enable(page)
    page.keyboard.press('Escape')
    shows(page, 'state', 'PAUSED')
    page.keyboard.down('KeyE')
    until(page, lambda: page.locator('#enable').evaluate(SHARE) > 0.0)
    page.keyboard.press('Escape')
    assert page.locator('#enable').evaluate(SHARE) == 0.0
    page.wait_for_timeout(HELD_MS)
    shows(page, 'state', 'PAUSED')
    page.keyboard.up('KeyE')


@pytest.mark.nightly
@pytest.mark.parametrize('covers', ['?', 'Meta'])
def test_what_covers_the_view_or_the_keys_lets_go(console, page, covers):
    enable(page)
    begin = console.now_ns
    press, release = press_keys(page, 'Space', 'ArrowLeft')
    grip(page, press, release, follows(console, page, begin))
    page.keyboard.press(covers)
    shows(page, 'lamp', 'OPEN')
    assert console.stands(page)
    release()


@pytest.mark.nightly
def test_a_view_that_is_turned_says_so_and_is_turned_back(console, page):
    box = page.locator('#space').bounding_box()
    page.mouse.move(box['x'] + box['width'] / 2, box['y'] + box['height'] / 2)
    page.mouse.down()
    page.mouse.move(box['x'] + box['width'] / 4, box['y'] + box['height'] / 2)
    page.mouse.up()
    page.get_by_role('button', name='View turned: reset').click()
    expect(page.locator('#view-reset')).to_be_hidden()


@pytest.mark.nightly
def test_help_tells_the_keys(console, page):
    page.keyboard.press('?')
    expect(page.locator('#help')).to_be_visible()
    expect(page.locator('#help')).to_contain_text('Space')
    page.keyboard.press('Escape')
    expect(page.locator('#help')).to_be_hidden()
    page.click('#help-open')
    page.get_by_role('button', name='Close').click()
    expect(page.locator('#help')).to_be_hidden()


def test_a_page_whose_server_ends_says_so_and_comes_back_without_the_controls(console, browser):
    with console.page(browser) as page:
        enable(page)
        console.end()
        expect(page.locator('#alarms')).to_contain_text('No connection')
        shows(page, 'lamp', 'UNKNOWN')
        expect(page.locator('#pause')).to_be_disabled()
        console.start()
        expect(page.locator('#alarms')).not_to_contain_text('No connection')
        shows(page, 'operator', 'nobody')
        # What a browser says of a server that is not there.
        refused = [text for text in page.complaints if 'ERR_CONNECTION_REFUSED' not in text]
        assert refused == []
        page.complaints.clear()


@pytest.mark.nightly
def test_a_page_without_its_key_says_what_to_do(console, browser):
    with browser.new_context() as context:
        page = context.new_page()
        page.goto(f'{console.address}/')
        expect(page.locator('#token')).to_contain_text('endoscope console')
        page.goto(f'{console.address}/?#token=wrong')
        expect(page.locator('#token')).to_contain_text('refused this page')
        page.fill('#token-address', f'{console.address}/#token={console.viewer}')
        page.get_by_role('button', name='Open', exact=True).click()
        expect(page.locator('#next')).to_contain_text('You are looking on')
        assert page.url == f'{console.address}/', 'the key is not left in the address'


@pytest.mark.nightly
@pytest.mark.parametrize(
    ('width', 'height', 'touch'), [(1440, 900, False), (1024, 768, True), (768, 1024, True)]
)
def test_all_of_it_fits_on_the_screen(console, browser, width, height, touch):
    how = {'viewport': {'width': width, 'height': height}, 'has_touch': touch}
    with console.page(browser, **how) as page:
        assert page.evaluate(OUTSIDE) == []
        assert page.evaluate(NAMELESS) == []
        root = 'document.documentElement'
        assert page.evaluate(f'[{root}.scrollWidth, {root}.scrollHeight]') == [width, height]
        sizes = page.evaluate(SIZES)
        assert sizes['state'] == max(sizes.values()), 'the state is the largest word'


@pytest.mark.nightly
def test_nothing_is_cut_or_out_of_reach_in_a_small_window(console, browser):
    with console.page(browser) as page:
        for width, height in ((1440, 900), (1280, 600), (1100, 560), (800, 600), (390, 844)):
            page.set_viewport_size({'width': width, 'height': height})
            page.wait_for_timeout(200)
            assert page.evaluate(CUT) == [], (width, height)
        expect(page.locator('#tab-plots')).to_be_hidden()
        expect(page.locator('#plots')).to_be_visible()


@pytest.mark.nightly
def test_nothing_flashes_for_who_asked_for_less_motion(console, browser):
    with console.page(browser, reduced_motion='reduce') as page:
        assert page.evaluate(ANIMATION) == 'none'
    with console.page(browser, reduced_motion='no-preference') as page:
        assert page.evaluate(ANIMATION) == 'alarm'
