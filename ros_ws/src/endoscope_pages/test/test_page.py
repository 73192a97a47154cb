"""The layout that pages share, and their tables."""

import re
import sys
from importlib import import_module

import pytest
from jinja2 import TemplateNotFound, UndefinedError

from endoscope_pages import html_table, render_page

TEMPLATE = """{% extends 'page.html.j2' %}
{% block title %}{{ name }}{% endblock %}
{% block body %}
<p>{{ name|loud }}</p>
{{ table|safe }}
{% endblock %}
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with a template of its own."""
    name = 'package_with_a_page'
    (tmp_path / name / 'templates').mkdir(parents=True)
    (tmp_path / name / '__init__.py').touch()
    (tmp_path / name / 'templates' / 'own.html.j2').write_text(TEMPLATE, encoding='utf-8')
    monkeypatch.syspath_prepend(tmp_path)
    import_module(name)
    yield name
    del sys.modules[name]


def rendered(package, **values):
    return render_page(package, 'templates/own.html.j2', filters={'loud': str.upper}, **values)


def test_a_template_fills_the_layout_and_what_it_shows_is_escaped(package):
    page = rendered(package, name='a < b', table=html_table(['c'], [['<i>']]))
    assert '<title>a &lt; b</title>' in page
    assert '<p>A &lt; B</p>' in page
    assert '<td>&lt;i&gt;</td>' in page
    body = page[page.index('<body>') :]
    assert body.index('</table>') < body.index('<script>') < body.index('</html>')


def test_a_page_needs_no_other_file(package):
    page = rendered(package, name='alone', table='')
    assert re.findall(r'(?:src|href)\s*=\s*["\']([^"\']+)', page) == ['data:,']
    assert '--curve-1' in page
    assert 'uPlot' in page


def test_what_a_template_lacks_is_named(package):
    with pytest.raises(UndefinedError, match='name'):
        rendered(package, table='')
    with pytest.raises(TemplateNotFound, match='absent'):
        render_page(package, 'templates/absent.html.j2')


def test_columns_of_words_are_on_the_left():
    table = html_table(['effect', 'unit', 'value'], [['slack', 'mm', 0.5]], words=2)
    assert re.findall(r'<(t[hd])( class="l")?>(.*?)</\1>', table) == [
        *[('th', ' class="l"', 'effect'), ('th', ' class="l"', 'unit'), ('th', '', 'value')],
        *[('td', ' class="l"', 'slack'), ('td', ' class="l"', 'mm'), ('td', '', '0.5')],
    ]
