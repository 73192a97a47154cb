"""Plots of a self-contained page under the hands of a reader, in a real browser."""

from collections.abc import Iterator
from html import escape
from typing import Literal

import numpy as np
import pytest
from chromium import drawn
from playwright.sync_api import Browser, Frame, Locator, Page, expect

from endoscope_pages import Curve, Plot, figure_html
from endoscope_pages.page import head, scripts

TIME = 1e-3 * np.arange(20_000)
ANGLE = 60.0 * np.sin(TIME)
LATE = 60.0 * np.sin(TIME - 0.4)
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"


def page_of_plots() -> str:
    """A loop and two plots over time of 20 s at 1 kHz; the second has a gap and a fault."""
    readings = 0.1 * np.cos(50.0 * TIME)
    readings[8000:9000] = np.nan
    readings[12_345] = 5.0
    plots = [
        Plot('loop (deg)', 'command (deg)', (Curve('tip', ANGLE, LATE, time=TIME),), loop=True),
        Plot(
            'angle (deg)',
            'time (s)',
            (
                Curve('tip', TIME[::10], LATE[::10], 'curve-1', to='command'),
                Curve('command', TIME[::10], ANGLE[::10], 'wanted', dash=(6.0, 4.0)),
            ),
        ),
        Plot('reading (N)', 'time (s)', (Curve('cell', TIME, readings, 'curve-2'),)),
    ]
    return (
        f'<!doctype html><html lang="en" class="report"><head><title>plots</title>'
        f'<link rel="icon" href="data:,">{head()}</head>'
        f'<body>{figure_html(plots)}{scripts()}</body></html>'
    )


WRITTEN = """<script>
const written = [], write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
  written.push(text);
  return write.call(this, text, ...rest);
};
</script>"""


AXES = (
    (1e-4, False, {'-0.0001', '-0.00005', '0', '0.00005', '0.0001'}),
    (0.5, False, {'-0.4', '-0.2', '0', '0.2', '0.4'}),
    (300.0, False, {'-200', '0', '200'}),
    (300.0, True, {'1', '10', '100'}),
)
"""Largest value, whether its logarithm is shown, and what stands at the axis."""


@pytest.mark.nightly
def test_places_on_an_axis_are_told_apart(browser: Browser) -> None:
    for size, log, ticks in AXES:
        values = np.geomspace(0.5, size, 200) if log else np.linspace(-size, size, 200)
        plot = Plot('value', 'time (s)', (Curve('one', TIME[:200], values),), log=log)
        content = f'<html><head>{head()}{WRITTEN}</head><body>{figure_html([plot])}{scripts()}'
        with drawn(content, within=browser) as (page, _):
            expect(page.locator('.plots.is-drawn')).to_be_visible()
            seen = page.evaluate('written.map((text) => text.replace("\u2212", "-"))')
        assert ticks <= set(seen)
        assert '-0' not in seen


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    with drawn(page_of_plots(), within=browser) as (page, complaints):
        yield page
        assert complaints == []


def across(page: Page | Frame, plot: int) -> list[float]:
    """What a plot shows from left to right."""
    seen = page.locator('.plot').nth(plot).get_attribute('data-across')
    assert seen
    return [float(end) for end in seen.split()]


def drag(page: Page, over: Locator, begin: float, end: float) -> None:
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box
    height = box['y'] + box['height'] / 2
    page.mouse.move(box['x'] + begin * box['width'], height)
    page.mouse.down()
    page.mouse.move(box['x'] + end * box['width'], height + 2, steps=4)
    page.mouse.up()


def inked(page: Page | Frame, plot: int, colour: str = 'actual') -> tuple[int, int]:
    """How many pixels of a plot a colour has, and the row of its highest one."""
    canvas = page.locator('.plot canvas').nth(plot)
    count, top = canvas.evaluate(
        """(canvas, name) => {
            const {width, height} = canvas;
            const context = new OffscreenCanvas(width, height).getContext('2d');
            context.drawImage(canvas, 0, 0);
            const {data} = context.getImageData(0, 0, width, height);
            const ink = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
            const [r, g, b] = [1, 3, 5].map(k => parseInt(ink.slice(k, k + 2), 16));
            const far = k => Math.hypot(data[k] - r, data[k + 1] - g, data[k + 2] - b);
            let count = 0, top = height;
            for (let k = 0; k < data.length; k += 4) {
                if (far(k) > 40 || data[k + 3] < 90) continue;
                count += 1;
                top = Math.min(top, Math.floor(k / 4 / width));
            }
            return [count, top];
        }""",
        f'--{colour}',
    )
    return int(count), int(top)


def test_drags_zoom_and_move_all_plots_over_time_and_a_loop_fades_outside(page: Page) -> None:
    everything = page.locator('.plots').get_by_label('show all')
    expect(everything).to_be_hidden()
    over = page.locator('.u-over').nth(1)
    drag(page, over, 0.25, 0.5)
    expect(everything).to_be_visible()
    for plot in (1, 2):
        assert across(page, plot) == pytest.approx([5.0, 10.0], abs=0.1)
    page.keyboard.down('Shift')
    drag(page, over, 0.8, 0.3)
    page.keyboard.up('Shift')
    assert across(page, 1) == pytest.approx([7.5, 12.5], abs=0.2)
    over.dblclick()
    expect(everything).to_be_hidden()
    for plot in (1, 2):
        assert across(page, plot) == pytest.approx([0.0, 20.0], abs=0.02)
    whole, _ = inked(page, 0)
    drag(page, over, 0.0, 0.05)
    expect(everything).to_be_visible()
    part, _ = inked(page, 0)
    assert 0 < part < 0.7 * whole
    everything.click()
    assert inked(page, 0)[0] == whole


def test_the_cursor_and_keys_read_out_and_a_curve_can_be_left_out(page: Page) -> None:
    # A millisecond of twenty seconds is less than a pixel, and reaches to the top all the same.
    _, top = inked(page, 2, 'curve-2')
    assert top < 30
    over = page.locator('.u-over').nth(1)
    over.scroll_into_view_if_needed()
    over.hover()
    told = page.locator('.plot-read')
    expect(told.nth(1)).to_contain_text('10.00 s')
    expect(told.nth(1)).to_contain_text(f'{60.0 * np.sin(10.0 - 0.4):.1f}')
    loop = told.nth(0).locator('div').text_content()
    assert float(loop or 'nan') == pytest.approx(60.0 * np.sin(10.0 - 0.4), abs=0.6)
    expect(page.locator('.plot-dot:visible')).to_have_count(4)
    page.mouse.move(1, 1)
    expect(told.nth(1)).to_be_hidden()
    page.locator('.plot').nth(1).focus()
    page.keyboard.press('+')
    assert across(page, 1) == pytest.approx([5.0, 15.0], abs=0.02)
    page.keyboard.press('Shift+ArrowRight')
    assert across(page, 2) == pytest.approx([6.0, 16.0], abs=0.02)
    page.keyboard.press('ArrowRight')
    expect(told.nth(1)).to_be_visible()
    page.keyboard.press('0')
    assert across(page, 1) == pytest.approx([0.0, 20.0], abs=0.02)
    assert inked(page, 1, 'wanted')[0] > 0
    command = page.get_by_role('button', name='command')
    command.click()
    expect(command).to_have_attribute('aria-pressed', 'false')
    assert inked(page, 1, 'wanted')[0] == 0


LOOKS: tuple[tuple[Literal['dark', 'light'], Literal['screen', 'print'], str], ...] = (
    ('dark', 'screen', 'rgb(20, 22, 26)'),
    ('light', 'screen', 'rgb(255, 255, 255)'),
    ('dark', 'print', 'rgb(255, 255, 255)'),
)


@pytest.mark.nightly
def test_the_look_follows_the_reader_and_paper_is_light(page: Page) -> None:
    """What is drawn, too: its colour is that of the scheme."""
    for scheme, media, ground in LOOKS:
        page.emulate_media(color_scheme='light', media='screen')
        page.emulate_media(color_scheme=scheme, media=media)
        assert page.evaluate('getComputedStyle(document.body).backgroundColor') == ground
        assert inked(page, 1, 'wanted')[0] > 0


def test_it_works_in_a_sandboxed_frame_that_allows_scripts_alone(browser: Browser) -> None:
    policy = f'<meta http-equiv="content-security-policy" content="{POLICY}">'
    framed = page_of_plots().replace('<head>', f'<head>{policy}')
    outside = (
        '<link rel="icon" href="data:,"><iframe sandbox="allow-scripts" width="1000" height="800" '
        f'srcdoc="{escape(framed)}"></iframe>'
    )
    with drawn(outside, within=browser) as (page, complaints):
        frame = page.frames[1]
        drag(page, frame.locator('.u-over').nth(1), 0.25, 0.5)
        assert across(frame, 2) == pytest.approx([5.0, 10.0], abs=0.1)
        assert inked(frame, 2, 'curve-2')[0] > 0
    assert complaints == []


@pytest.mark.nightly
def test_without_javascript_it_says_so_and_has_the_numbers(browser: Browser) -> None:
    with drawn(page_of_plots(), within=browser, java_script_enabled=False) as (page, complaints):
        expect(page.get_by_text('Without JavaScript')).to_be_visible()
        page.get_by_text('Numbers', exact=True).click()
        expect(page.get_by_role('cell', name='20000')).to_be_visible()
    assert complaints == []
