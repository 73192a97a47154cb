"""Settings for the tests of all packages."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))
pytest_plugins = ['run_report', 'explained_corpus']
