"""The look of all pages, and the plotting library that they carry."""

import hashlib
import re
from itertools import product

import pytest

from endoscope_pages import ASSETS

LOOK = (ASSETS / 'look.css').read_text(encoding='utf-8')
READ = ('ink', 'quiet', 'wanted', 'following', 'held', 'open', 'good', 'finding')
"""Colours in which words are set."""
CURVES = ('actual', *(f'curve-{k}' for k in range(1, 6)), 'wire-x-pos', 'wire-y-pos')


def schemes():
    """Colours of the dark and the light look, by their names."""
    blocks = re.findall(r'(:root[.\w]*) \{(.*?)\}', LOOK, flags=re.DOTALL)
    found = {
        selector: dict(re.findall(r'--([\w-]+): (#[0-9a-f]{6});', block))
        for selector, block in blocks
    }
    return {'dark': found[':root'], 'light': found[':root.report']}


def contrast(first, second):
    """Contrast of two colours as WCAG 2.2 defines it, 1 to 21."""

    def luminance(colour):
        share = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in share]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    dark, light = sorted((luminance(first), luminance(second)))
    return (light + 0.05) / (dark + 0.05)


def test_uplot_is_the_published_one_and_its_licence_comes_with_it():
    notice = (ASSETS / 'NOTICE.uPlot').read_text(encoding='utf-8')
    named = dict(re.findall(r'^([0-9a-f]{64})  (\S+)$', notice, flags=re.MULTILINE))
    assert set(named.values()) == {'uPlot.iife.min.js', 'uPlot.min.css', 'LICENSE.uPlot'}
    for digest, name in named.items():
        assert hashlib.sha256((ASSETS / name).read_bytes()).hexdigest() == digest, name
    (version,) = set(re.findall(r'\d+\.\d+\.\d+', notice))
    assert f'(v{version})' in (ASSETS / 'uPlot.iife.min.js').read_text(encoding='utf-8')[:100]
    assert 'MIT' in (ASSETS / 'LICENSE.uPlot').read_text(encoding='utf-8')


def test_the_light_look_has_every_colour_of_the_dark_one():
    colours = schemes()
    assert colours['dark'].keys() == colours['light'].keys()


@pytest.mark.parametrize('scheme', ['dark', 'light'])
def test_words_and_curves_stand_out_from_what_is_behind_them(scheme):
    colours = schemes()[scheme]
    for name, behind in product(READ, ('background', 'surface')):
        assert contrast(colours[name], colours[behind]) >= 4.5, (name, behind)
    assert contrast(colours['ink'], colours['fill']) >= 4.5
    for name in CURVES:
        assert contrast(colours[name], colours['background']) >= 3.0, name
    for level in ('high', 'medium', 'low'):
        assert contrast(colours['on-alarm'], colours[f'alarm-{level}']) >= 4.5, level


def test_every_colour_that_is_used_is_defined():
    used = set(re.findall(r'var\(--([\w-]+)\)', LOOK))
    assert used <= set(re.findall(r'^ *--([\w-]+):', LOOK, flags=re.MULTILINE))
