import re

import pytest

from endoscope_nodes import graph

pytestmark = pytest.mark.nightly


def test_it_is_said_what_arrives_and_which_rate_is_carried(monkeypatch, capfd):
    monkeypatch.setattr(graph, 'RATES', (250, 100))
    monkeypatch.setattr(graph, '_COUNTED_S', 1.0)
    status = graph.check_rates()
    *tried, verdict = capfd.readouterr().out.splitlines()
    shares = [
        float(re.match(r' *(?:250|100) Hz: (\d+\.\d) % of the commands reach', line)[1])
        for line in tried
    ]
    if status == 0:
        assert shares[-1] >= 99.0
        assert re.search(r'carries (250|100) Hz in real time', verdict)
    else:
        assert len(tried) == 2
        assert 'does not even carry 100 Hz' in verdict
