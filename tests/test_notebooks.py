"""The example notebook, run by a kernel as a reader runs it, and the outputs that it keeps."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.nightly

DOC = Path(__file__).parents[1] / 'ros_ws/doc'
NOTEBOOK = DOC / 'notebooks/explain_a_recording.ipynb'


@pytest.fixture(scope='module')
def executed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The notebook as `make -C ros_ws notebook` would keep it now."""
    for package in ('nbformat', 'nbclient', 'ipykernel'):
        pytest.importorskip(package, reason='notebooks are run by nbclient and ipykernel')
    out = tmp_path_factory.mktemp('notebook') / NOTEBOOK.name
    subprocess.run([sys.executable, DOC / 'run_notebook.py', NOTEBOOK, out], check=True)
    return out


def _outputs(notebook: Path) -> list[dict[str, Any]]:
    cells = json.loads(notebook.read_text(encoding='utf-8'))['cells']
    return [output for cell in cells for output in cell.get('outputs', ())]


def _in_words(notebook: Path) -> list[str]:
    """Return what each output says, and that it has a picture where it has one."""
    said = []
    for output in _outputs(notebook):
        data = output.get('data', {})
        words = output.get('text') or data.get('text/plain') or []
        said.append(''.join([*words, *(['picture'] if 'image/png' in data else [])]))
    return said


def test_it_keeps_outputs_and_nothing_of_who_made_them() -> None:
    text = NOTEBOOK.read_text(encoding='utf-8')
    assert len(text) < 1_000_000
    cells = json.loads(text)['cells']
    counts = [cell['execution_count'] for cell in cells if cell['cell_type'] == 'code']
    assert counts == list(range(1, len(counts) + 1)), 'run `make -C ros_ws notebook`'
    assert all(cell['metadata'] == {} for cell in cells)
    assert len(_outputs(NOTEBOOK)) >= 6
    assert not re.search(r'/(tmp|home|root|usr)/|\b20\d\d-\d\d-\d\d', ''.join(_in_words(NOTEBOOK)))


@pytest.mark.timeout(900)
def test_the_outputs_kept_are_those_of_the_code(executed: Path) -> None:
    assert _in_words(NOTEBOOK) == _in_words(executed), 'run `make -C ros_ws notebook`, and commit'


@pytest.mark.timeout(900)
def test_it_runs_and_finds_what_was_concealed(executed: Path) -> None:
    outputs = _outputs(executed)
    assert not [o for o in outputs if o['output_type'] == 'error']
    shown = [o['data'] for o in outputs if o['output_type'] == 'execute_result']
    signals, explained = (''.join(data['text/plain']) for data in shown)
    assert 'wires/measured_js:wire_x_pos' in signals
    assert 'The simulation leaves out gravity on bend_x.' in explained
    text = ''.join(''.join(o['text']) for o in outputs if o['output_type'] == 'stream')
    [moment] = re.findall(r'moment_nm = \S+ N m \((\S+) to (\S+)\)', text)
    assert float(moment[0]) <= 0.02 <= float(moment[1])
    before, now = map(float, re.search(r'(\S+) deg before, (\S+) deg now', text).groups())
    assert now < 0.25 * before
    figures = [o for o in outputs if 'image/png' in o.get('data', {})]
    assert len(figures) == 2
