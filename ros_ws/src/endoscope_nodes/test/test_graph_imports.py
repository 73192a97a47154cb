"""What a process of nodes loads before it serves."""

import subprocess
import sys

NOT_FOR_NODES = {'torch', 'matplotlib', 'endoscope_explain'}
NOT_FOR_NODES |= {'scipy.signal', 'scipy.stats'}


def test_the_graph_loads_nothing_that_only_training_and_reports_need():
    program = (
        'import sys\n'
        'import endoscope_nodes.graph\n'
        f'print(*sorted(set(sys.modules) & {NOT_FOR_NODES!r}))\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=False
    )
    assert done.stderr == ''
    assert done.stdout.strip() == ''
