"""A self-contained page: it needs no other file and no network.

It works inside a sandboxed frame that allows scripts. A template extends `page.html.j2`, which has
the blocks `title`, `style` and `body`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

ASSETS = Path(__file__).with_name('assets')
"""Folder of style sheets and scripts, which the console serves and reports carry."""

_LEFT = ' class="l"'
_STYLES = ('uPlot.min.css', 'look.css')
_SCRIPTS = ('uPlot.iife.min.js', 'drawing.js', 'zoomable.js')


def render_page(
    package: str,
    template: str,
    /,
    *,
    filters: Mapping[str, Callable[..., str]] | None = None,
    **values: object,
) -> str:
    """Fill a package's template into the layout that all pages share.

    Parameters
    ----------
    package : str
        Name of the package that has the template.
    template : str
        Path of the template below the package.
    filters : mapping of str to callable, optional
        Filters of the template's own, by name.
    **values : object
        What the template names. Text is escaped.

    Returns
    -------
    str
        HTML with its style sheets and scripts.

    Raises
    ------
    jinja2.TemplateNotFound
        The package has no such template.
    jinja2.UndefinedError
        The template names what is not given.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader('endoscope_pages'), PackageLoader(package, '')]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(filters or {})
    return environment.get_template(template).render(values, head=head(), scripts=scripts())


def head() -> str:
    """Return the look of a page with plots, as one `<style>` element."""
    return '<style>\n' + '\n'.join(map(_text, _STYLES)) + '\n</style>'


def scripts() -> str:
    """Return the `<script>` elements that stand at the end of a page with plots."""
    return ''.join(f'<script>{_text(name)}</script>\n' for name in _SCRIPTS)


def html_table(header: Sequence[str], rows: Iterable[Iterable[object]], words: int = 0) -> str:
    """Return a table that scrolls where the page is narrower.

    Parameters
    ----------
    header : sequence of str
        Titles of the columns.
    rows : iterable of iterables
        Cells of each row, as text.
    words : int, optional
        How many columns, from the first, hold words and are aligned left; others hold numbers.

    Returns
    -------
    str
        A `<div>` with the table.
    """
    lines = ''.join(f'<tr>{_cells("td", row, words)}</tr>' for row in rows)
    return (
        f'<div class="scroll"><table><thead><tr>{_cells("th", header, words)}</tr></thead>'
        f'<tbody>{lines}</tbody></table></div>'
    )


def _cells(tag: str, cells: Iterable[object], words: int) -> str:
    return ''.join(
        f'<{tag}{_LEFT if column < words else ""}>{escape(str(cell))}</{tag}>'
        for column, cell in enumerate(cells)
    )


def _text(name: str) -> str:
    return (ASSETS / name).read_text(encoding='utf-8')
