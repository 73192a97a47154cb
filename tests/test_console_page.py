"""The page of the console in a real browser: each button, each kind of hand, what ends a grip.

Five journeys for every change; the others are tried at night.
"""

import re

import browsed_console
import pytest
from browsed_console import (
    enable,
    grip,
    hold,
    hold_enable,
    shows,
    take,
    until,
)
from playwright.sync_api import expect
from pushed_tip import PushedTip

SHARE = "(button) => Number(button.style.getPropertyValue('--share'))"
# Longer than a button has to be held.
HELD_MS = 1500
FAR = 0.03
"""rad at a motor's shaft that no noise makes."""
FOLLOWING = "document.getElementById('lamp').textContent === 'FOLLOWING'"
GAMEPAD = """
window.pad = { connected: true, mapping: 'standard', index: 0, id: 'made up', axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })),
  vibrationActuator: { playEffect: async (kind, how) => { rumbles.push([kind, how]); } } };
window.rumbles = [];
window.plugged = true;
Navigator.prototype.getGamepads = () => [window.plugged ? window.pad : null];
"""
ALARMED = """() => {
  const { width, height } = document.getElementById('space');
  const copy = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
  copy.drawImage(document.getElementById('space'), 0, 0);
  const { data } = copy.getImageData(0, 0, width, height);
  const found = [];
  for (let k = 0; k < data.length; k += 4) {
    const is = data[k] > 240 && data[k + 1] < 80 && data[k + 2] < 70;
    if (is) found.push(((k / 4) % width) / width);
  }
  return found;
}"""
"""Where the view has the colour of an alarm, 0 to 1 across it."""
REPEATS = """
Object.defineProperty(WebSocket.prototype, 'onmessage', { set(take) {
  this.addEventListener('message', ({ data }) => {
    if (String(data).includes('"ENGAGED"')) window.saidAgain = () => take({ data });
    take({ data });
  });
} });
"""


# pytest looks for the fixtures of a test in its own module.
running, console, page = browsed_console.running, browsed_console.console, browsed_console.page


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
    return (
        lambda: [page.keyboard.down(key) for key in keys],
        lambda: [page.keyboard.up(key) for key in reversed(keys)],
    )


def test_a_stranger_is_led_to_the_first_motion_by_keys_and_a_release_ends_it(console, browser):
    with console.page(browser) as page:
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
        page.keyboard.up('Space')
        shows(page, 'lamp', 'OPEN')
        assert console.stands(page), 'an arrow that is still down moves nothing'
        release()
        actual = page.locator('#plots [data-value]').nth(1)
        assert abs(float(actual.inner_text())) < 100.0, 'the plots show where it is, in deg'


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


def test_a_force_at_the_tip_is_drawn_felt_and_alarmed_until_it_is_silent(console, browser):
    tip = console.ask(PushedTip)
    viewport = {'width': 1024, 'height': 768}
    with console.page(browser, script=GAMEPAD, viewport=viewport) as page:
        shows(page, 'force-why', 'no force: silent')
        take(page)
        tip.force = 0.03, -0.02
        shows(page, 'force-between', 'nothing above 0.08 N')
        assert page.evaluate('rumbles') == []
        tip.force = -0.24, 0.07
        shows(page, 'force-size', '0.25 N')
        shows(page, 'force-between', '(0.18 to 0.33)')
        expect(page.locator('#alarms .high')).to_contain_text(['0.25 N at the tip, above 0.2 N'])
        until(page, lambda: len(page.evaluate(ALARMED)) > 100, 'an arrow')
        assert min(page.evaluate(ALARMED)) > 0.5, 'it comes from the right, where it pushes from'
        until(page, lambda: page.evaluate('rumbles.length > 1'), 'a rumble')
        kind, how = page.evaluate('rumbles.at(-1)')
        assert (kind, how['strongMagnitude']) == ('dual-rumble', 1)
        page.uncheck('#rumble')
        felt = page.evaluate('rumbles.length')
        tip.force = -0.14, 0.0
        shows(page, 'force-size', '0.14 N')
        expect(page.locator('#alarms')).not_to_contain_text('N at the tip')
        assert page.evaluate('rumbles.length') == felt
        tip.force = None
        shows(page, 'force-why', 'no force: silent')
        expect(page.locator('#force-bar')).to_be_hidden()
        until(page, lambda: page.evaluate(ALARMED) == [])
    console.ask(lambda _: tip.close())


@pytest.mark.parametrize(
    ('script', 'reason'),
    [
        ("dispatchEvent(new Event('blur'))", 'this page is not in front'),
        *(
            pytest.param(*one, marks=pytest.mark.nightly)
            for one in (
                ("document.dispatchEvent(new Event('freeze'))", 'this page was frozen'),
                ("document.getElementById('tab-see').click()", 'the section is out of sight'),
            )
        ),
    ],
)
def test_what_takes_the_page_away_lets_go_at_once_and_says_why(console, browser, script, reason):
    # What the server said before it heard of that hides no reason.
    with console.page(browser, script=REPEATS) as page:
        enable(page)
        begin = console.now_ns
        press, release = press_keys(page, 'Space', 'ArrowLeft')
        left = leaves(console, page, begin, f'{script}; saidAgain()')
        grip(page, press, release, left)
        shows(page, 'lamp', 'OPEN')
        shows(page, 'lamp-why', reason)
        page.evaluate("dispatchEvent(new Event('focus'))")
        page.keyboard.down('Space')
        assert console.stands(page), 'a key that is held all along does not engage again'
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
    page.wait_for_timeout(HELD_MS)
    shows(page, 'state', 'DISABLED')
    enable(page)
    page.keyboard.press('Escape')
    shows(page, 'state', 'PAUSED')
    page.keyboard.down('KeyE')
    until(page, lambda: page.locator('#enable').evaluate(SHARE) > 0.0)
    page.keyboard.press('Escape')
    assert page.locator('#enable').evaluate(SHARE) == 0.0, 'a pause ends what is held to resume'
    page.wait_for_timeout(HELD_MS)
    shows(page, 'state', 'PAUSED')
    page.keyboard.up('KeyE')


@pytest.mark.nightly
def test_what_covers_the_view_or_the_keys_lets_go(console, page):
    for covers in ('Meta', '?'):
        enable(page)
        begin = console.now_ns
        press, release = press_keys(page, 'Space', 'ArrowLeft')
        grip(page, press, release, follows(console, page, begin))
        page.keyboard.press(covers)
        shows(page, 'lamp', 'OPEN')
        assert console.stands(page)
        release()


@pytest.mark.nightly
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
