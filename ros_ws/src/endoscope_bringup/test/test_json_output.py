"""`--json`: what tables show, as one document."""

import json
import math
from pathlib import Path

from endoscope_bringup.subcommands import print_json


def test_numbers_stay_numbers_and_what_json_lacks_becomes_null(capsys):
    print_json({'a': (1, 2.5, True), 'b': math.nan, 'c': -math.inf, 'd': Path('x/ä'), 7: None})
    content = json.loads(capsys.readouterr().out)
    assert content == {'a': [1, 2.5, True], 'b': None, 'c': None, 'd': 'x/ä', '7': None}
