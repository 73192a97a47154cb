"""What of the page needs no browser: its frames are those of the server, its rules hold."""

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import endoscope_console
from endoscope_console.teleop.frames import InputFrame, decode_input, encode_telemetry

PAGE = Path(endoscope_console.__file__).parent / 'page'
TESTS = Path(__file__).parent / 'page'
FRAMES = """
import { readFileSync } from 'node:fs';
import { decodeTelemetry, encodeInput } from './page/frames.js';
const { picture, inputs } = JSON.parse(readFileSync(0));
const bytes = Uint8Array.from(Buffer.from(picture, 'hex'));
const { seq, stamp, age, ranges, wanted, actual } = decodeTelemetry(bytes.buffer);
const others = [bytes.slice(0, 20), bytes.slice(0, -1), bytes.with(0, 2), bytes.with(1, 9)];
const refused = others.map((bad) => {
  try { decodeTelemetry(bad.buffer); } catch (error) { return error.name; }
});
const row = (values) => [...values].map((value) => (Number.isNaN(value) ? null : value));
console.log(JSON.stringify({
  seq, stamp, age, ranges: row(ranges), wanted: row(wanted), actual: row(actual), refused,
  inputs: inputs.map((frame) => Buffer.from(encodeInput(frame)).toString('hex')),
}));
"""


@pytest.fixture(scope='module')
def modules(tmp_path_factory):
    """Return a folder with the page and its tests, as node takes them."""
    if not shutil.which('node'):
        pytest.skip('the modules of the page are tested by node, which is not installed')
    folder = tmp_path_factory.mktemp('page')
    shutil.copytree(PAGE, folder / 'page')
    shutil.copytree(TESTS, folder / 'test')
    (folder / 'package.json').write_text('{"type": "module"}', encoding='utf-8')
    return folder


def _node(*words, folder, **more):
    return subprocess.run(
        ['node', *words], cwd=folder, capture_output=True, text=True, check=False, **more
    )


@pytest.mark.parametrize('file', sorted(path.name for path in TESTS.glob('*.test.js')))
def test_rules_of_the_page(modules, file):
    done = _node('--test', f'test/{file}', folder=modules)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r'^# pass [1-9]', done.stdout, re.MULTILINE), done.stdout


def test_frames_are_those_of_the_server(modules):
    rng = np.random.default_rng(3)
    ranges, wanted, actual = (rng.normal(size=shape) for shape in ((12, 3), (40, 3), (40, 3)))
    ranges[4] = actual[7] = np.nan
    picture = encode_telemetry(4_000_000_000, 1.7e9 + 0.123, 0.004, ranges, wanted, actual)
    frames = [
        InputFrame(True, False, True, True, False, 0, 1, 2, 3, 12.5, -1.0, 0.25),
        InputFrame(False, True, False, False, True, 2, 2**32 - 1, 2**31, 5, 1e6 + 0.02, 0.0, 3.5),
    ]
    inputs = [vars(frame) | {'position': frame.position_mode} for frame in frames]
    (modules / 'frames.mjs').write_text(FRAMES, encoding='utf-8')
    done = _node(
        'frames.mjs', folder=modules, input=json.dumps({'picture': picture.hex(), 'inputs': inputs})
    )
    assert done.returncode == 0, done.stderr
    shown = json.loads(done.stdout)
    assert (shown['seq'], shown['stamp'], shown['age']) == (4_000_000_000, 1.7e9 + 0.123, 0.004)
    for name, sent in (('ranges', ranges), ('wanted', wanted), ('actual', actual)):
        heard = np.array(shown[name], dtype=float).reshape(sent.shape)
        np.testing.assert_array_equal(heard, sent.astype(np.float32))
    assert shown['refused'] == ['RangeError'] * 4
    assert [decode_input(bytes.fromhex(frame)) for frame in shown['inputs']] == frames


class _Page(HTMLParser):
    def __init__(self):
        super().__init__()
        self.ids, self.words, self.inline = [], [], []
        self.texts = {'button': set(), 'li': set()}
        self.describing = set()
        self._script, self._in = False, ''

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.ids += [attributes['id']] if 'id' in attributes else []
        self.inline += [name for name in attributes if name == 'style' or name.startswith('on')]
        self.words += [attributes.get(name, '') for name in ('src', 'href')]
        self._script = tag in ('script', 'style')
        self._in = tag if tag in self.texts else self._in
        self.describing |= (
            {attributes['aria-describedby']} if 'aria-describedby' in attributes else set()
        )
        self.inline += ['style'] if tag == 'style' else []

    def handle_data(self, data):
        if self._script and data.strip():
            self.inline.append(data)
        if self._in and data.strip():
            self.texts[self._in].add(data.strip())

    def handle_endtag(self, tag):
        self._script = False
        self._in = '' if tag == self._in else self._in


def test_the_page_keeps_to_its_policy_and_needs_no_network():
    page = _Page()
    page.feed((PAGE / 'index.html').read_text(encoding='utf-8'))
    assert page.inline == []
    assert len(page.ids) == len(set(page.ids))
    assert page.texts['button'] & page.texts['li'] == set(), 'a step is not named as its button'
    assert page.describing
    assert page.describing <= set(page.ids)
    assert [word for word in page.words if '//' in word] == []
    for path in PAGE.glob('*.js'):
        code = re.sub(
            r'/\*.*?\*/|(?<!:)//[^\n]*', '', path.read_text(encoding='utf-8'), flags=re.DOTALL
        )
        found = re.findall(r'https?://|innerHTML|\beval\(|new Function|Worker', code)
        assert found == [], path.name


def test_what_modules_look_for_is_on_the_page():
    page = _Page()
    page.feed((PAGE / 'index.html').read_text(encoding='utf-8'))
    sought = {
        name
        for path in PAGE.glob('*.js')
        for name in re.findall(r"\$\('([a-z-]+)'\)", path.read_text(encoding='utf-8'))
    }
    assert sought
    assert sought <= set(page.ids)
