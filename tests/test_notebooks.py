"""The example notebook, run by a kernel as a reader runs it."""

import json
import re
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[1] / 'ros_ws/doc/notebooks/explain_a_recording.ipynb'


def test_it_is_kept_without_outputs():
    cells = json.loads(NOTEBOOK.read_text())['cells']
    code = [cell for cell in cells if cell['cell_type'] == 'code']
    assert code
    assert all(cell['outputs'] == [] and cell['execution_count'] is None for cell in code)


@pytest.mark.timeout(900)
def test_it_runs_and_finds_what_was_concealed(tmp_path):
    nbformat = pytest.importorskip('nbformat', reason='notebooks are run by nbclient and ipykernel')
    nbclient = pytest.importorskip('nbclient', reason='notebooks are run by nbclient and ipykernel')
    pytest.importorskip('ipykernel', reason='notebooks are run by nbclient and ipykernel')
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=800, resources={'metadata': {'path': tmp_path}}
    ).execute()
    outputs = [
        output for cell in notebook.cells for output in cell.get('outputs', ()) if cell.outputs
    ]
    assert not [o for o in outputs if o.output_type == 'error']
    shown = [o.data['text/html'] for o in outputs if 'text/html' in o.get('data', {})]
    # The signals of the recording, and the explanation: tables with pictures, no other files.
    assert len(shown) == 2
    for html in shown:
        assert '<table>' in html
        assert 'src="data:image/png;base64,' in html
        assert not re.search(r'(src|href)="(?!data:)', html)
    assert '<td>gravity</td>' in shown[1]
    text = ''.join(o.text for o in outputs if o.output_type == 'stream')
    [moment] = re.findall(r'moment_nm = \S+ N m \((\S+) to (\S+)\)', text)
    assert float(moment[0]) <= 0.02 <= float(moment[1])
    before, now = map(float, re.search(r'(\S+) deg before, (\S+) deg now', text).groups())
    assert now < 0.25 * before
    figures = [o for o in outputs if 'image/png' in o.get('data', {})]
    assert len(figures) == 2
