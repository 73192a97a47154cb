"""Pages in a real browser."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from playwright.sync_api import Browser, Page, Route, sync_playwright

LARGEST_PAGE = 3_000_000
"""Characters of a page that holds its plots."""

ADDRESS = 'http://report.invalid/'


@contextmanager
def chromium() -> Iterator[Browser]:
    """The installed Chromium."""
    program = shutil.which('chromium')
    assert program, 'the tests of the pages need a browser: apt install chromium fonts-dejavu-core'
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=['--no-sandbox'])
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def drawn(
    content: str, headers: dict[str, str] | None = None, within: Browser | None = None, **how: bool
) -> Iterator[tuple[Page, list[str]]]:
    """A page that has been drawn, and what the browser complains of.

    Any request but that for the page itself is such a complaint. Without a browser to draw it
    within it has one of its own.
    """
    complaints: list[str] = []

    def answer(route: Route) -> None:
        if route.request.url == ADDRESS:
            route.fulfill(body=content, headers={'content-type': 'text/html'} | (headers or {}))
        else:
            complaints.append(f'asked for {route.request.url}')
            route.abort()

    with (
        nullcontext(within) if within else chromium() as browser,
        browser.new_context(viewport={'width': 1200, 'height': 900}, **how) as context,
    ):
        page = context.new_page()
        page.route('**/*', answer)
        page.on('console', lambda message: complaints.append(f'{message.type}: {message.text}'))
        page.on('pageerror', lambda error: complaints.append(str(error)))
        page.goto(ADDRESS)
        yield page, complaints
