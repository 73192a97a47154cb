"""Real recordings and reference cases, which lie outside the repository."""

import os
from pathlib import Path

import pytest

SHARED = Path(os.environ.get('ENDOSCOPE_SHARED', Path(__file__).parents[2] / 'shared'))
REAL = SHARED / 'data' / 'kaist'
CASES = SHARED / 'cases'


def needs(path: Path) -> pytest.MarkDecorator:
    """Skip where the path is absent; the run says at its end, in one line, how many did."""
    return pytest.mark.skipif(
        not path.exists(),
        reason='recordings outside the repository are absent; ENDOSCOPE_SHARED names their folder',
    )
