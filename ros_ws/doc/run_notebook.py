"""Runs a notebook and keeps its outputs: `make -C ros_ws notebook`."""

import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def run(source: Path, out: Path) -> None:
    """Run a notebook in an empty folder and write it to `out`, without the times of the run."""
    notebook = nbformat.read(source, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(
            notebook, timeout=800, record_timing=False, resources={'metadata': {'path': folder}}
        ).execute()
    # The kernel notes the patch level of its Python.
    notebook.metadata.language_info = {'name': 'python'}
    nbformat.write(notebook, out)


if __name__ == '__main__':
    run(Path(sys.argv[1]), Path(sys.argv[-1]))
