"""What the page of the console shows in a real browser: all of it, to whom it may concern."""

import re

import browsed_console
import pytest
from browsed_console import shows
from playwright.sync_api import expect
from pushed_tip import PushedTip

pytestmark = pytest.mark.nightly

# pytest looks for the fixtures of a test in its own module.
running, console, page = browsed_console.running, browsed_console.console, browsed_console.page
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
CUT = """(scrolls) => {
  const sought = 'button, input, select, h1, dd, canvas, .touch, #next, figcaption';
  return [...document.querySelectorAll(sought)].filter((element) => {
    if (!element.checkVisibility() || element.closest('dialog')) return false;
    const block = element.closest('.bar, #view') ? 'nearest' : 'end';
    if (scrolls) element.scrollIntoView({ block });
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
"""What is out of sight, or, where one scrolls, cannot be brought into it."""
WHITE = 'rgb(242, 244, 248)'
ANIMATION = """() => {
  const alarm = document.createElement('div');
  alarm.className = 'alarm high';
  document.body.append(alarm);
  return getComputedStyle(alarm).animationName;
}"""


def test_whoever_looks_on_can_do_nothing(console, browser, page):
    with console.page(browser, token=console.viewer) as viewer:
        shows(viewer, 'next', 'You are looking on. To operate, open the operator’s address.')
        expect(viewer.locator('#age')).to_contain_text('ms')
        expect(viewer.locator('#claim')).to_be_disabled()
        expect(viewer.locator('#claim')).not_to_have_css('background-color', WHITE)
        viewer.keyboard.press('Escape')
        viewer.click('#tab-explain')
        expect(viewer.locator('#ask-go')).to_be_disabled()


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


def test_help_lists_the_keys_and_a_view_that_is_turned_is_turned_back(console, page):
    page.keyboard.press('?')
    expect(page.locator('#help')).to_contain_text('Space')
    page.keyboard.press('Escape')
    expect(page.locator('#help')).to_be_hidden()
    page.click('#help-open')
    page.get_by_role('button', name='Close').click()
    expect(page.locator('#help')).to_be_hidden()
    box = page.locator('#space').bounding_box()
    page.mouse.move(box['x'] + box['width'] / 2, box['y'] + box['height'] / 2)
    page.mouse.down()
    page.mouse.move(box['x'] + box['width'] / 4, box['y'] + box['height'] / 2)
    page.mouse.up()
    page.get_by_role('button', name='View turned: reset').click()
    expect(page.locator('#view-reset')).to_be_hidden()


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


def test_nothing_flashes_for_who_asked_for_less_motion(console, browser):
    with console.page(browser, reduced_motion='reduce') as page:
        assert page.evaluate(ANIMATION) == 'none'
    with console.page(browser, reduced_motion='no-preference') as page:
        assert page.evaluate(ANIMATION) == 'alarm'


@pytest.mark.parametrize(
    ('width', 'height', 'touch'), [(1440, 900, False), (1024, 768, True), (768, 1024, True)]
)
def test_all_of_it_fits_on_the_screen(console, browser, width, height, touch):
    how = {'viewport': {'width': width, 'height': height}, 'has_touch': touch}
    with console.page(browser, **how) as page:
        assert page.evaluate(CUT, False) == []
        assert page.evaluate(NAMELESS) == []
        root = 'document.documentElement'
        assert page.evaluate(f'[{root}.scrollWidth, {root}.scrollHeight]') == [width, height]
        sizes = page.evaluate(SIZES)
        assert sizes['state'] == max(sizes.values()), 'the state is the largest word'


def test_the_force_has_a_plot_and_a_loop_and_hides_nothing(console, browser):
    tip = console.ask(PushedTip)
    tip.force = -0.24, 0.07
    with console.page(browser) as page:
        plot = page.locator('#plots figure', has_text='force at the tip')
        expect(plot.locator('[data-value]')).to_have_text(['-0.24', '0.07'])
        page.click('#loops-force')
        expect(page.locator('#loops [data-of]')).to_have_text(['force', 'force'])
        assert page.evaluate(CUT, False) == []
        page.click('#loops-force')
        expect(page.locator('#loops [data-of]')).to_have_text(['RMS error', 'RMS error'])
    console.ask(lambda _: tip.close())


def test_nothing_is_cut_or_out_of_reach_in_a_small_window(console, browser):
    with console.page(browser) as page:
        for width, height in ((1280, 600), (1100, 560), (800, 600), (390, 844)):
            page.set_viewport_size({'width': width, 'height': height})
            page.wait_for_timeout(200)
            assert page.evaluate(CUT, True) == [], (width, height)
        expect(page.locator('#tab-plots')).to_be_hidden()
        expect(page.locator('#plots')).to_be_visible()
