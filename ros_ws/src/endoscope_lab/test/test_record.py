"""The record of explained cases: what is stored, and how a later run differs."""

from dataclasses import replace

import pytest

from endoscope_bringup.cli import main
from endoscope_core.errors import EndoscopeError
from endoscope_explain.prediction_set import Contest
from endoscope_lab.bench import keep_row
from endoscope_lab.concealed import confusion
from endoscope_lab.concealed.row import rows_of
from endoscope_lab.concealed.sets import JudgedContest
from endoscope_lab.concealed.trial import failed

ROW = replace(
    failed('sinusoid', 7, ValueError('a test')),
    verdict='missing_physics',
    reported=('gravity@bend_x',),
    nominal=60.0,
    refitted=7.0,
    augmented=1.05,
    held=2,
    intervals=2,
    errors=(1.0, 0.2),
)


LEFT_OPEN = JudgedContest(
    Contest((('gravity',), ('joint_stop',), ('cogging',)), (500.0, 500.0, 0.0), 3.0, True, 0.0),
    'bend_x',
    'joint_stop',
    (True, False, False, False, False),
)


@pytest.fixture
def record(tmp_path):
    file = tmp_path / 'rows.jsonl'
    keep_row(file, ROW)
    return file


def test_a_row_is_read_as_it_was_kept(record):
    keep_row(record, replace(ROW, seed=8))
    assert {key: row.reported for key, row in rows_of(record).items()} == {
        ('sinusoid', 7): ROW.reported,
        ('sinusoid', 8): ROW.reported,
    }
    assert rows_of(record)['sinusoid', 7].errors == ROW.errors


def test_a_line_that_was_cut_is_named(record):
    record.write_text(record.read_text() + '{"stratum": "nul')
    with pytest.raises(EndoscopeError, match=r'rows\.jsonl, line 2: no row of a case'):
        rows_of(record)


def test_what_is_confounded_is_counted_and_drawn(record, tmp_path):
    row = replace(ROW, concealed=('gravity@bend_x', 'cogging@bend_y'))
    wrong = replace(row, contests=(LEFT_OPEN.kept(),))
    right = replace(row, contests=(replace(LEFT_OPEN, reported='gravity').kept(),))
    assert confusion.confusions([wrong, right, right, ROW]) == {
        ('gravity', 'joint_stop', True): 1,
        ('gravity', 'joint_stop', False): 2,
    }
    keep_row(record, replace(wrong, seed=8))
    page = tmp_path / 'page.html'
    words = ['bench', 'concealed', '--stratum', 'sinusoid', '--json', str(record)]
    assert main([*words, '--seeds', '8', '--page', str(page)]) == 0
    assert '<title>gravity, called joint_stop: 1</title>' in page.read_text()


@pytest.mark.nightly
def test_a_run_resumes_where_it_was_stopped_and_reports_differences(record, capsys):
    # No explanation of this case would give the rows on record.
    words = ['bench', 'concealed', '--against', str(record)]
    assert main([*words, '--json', str(record)]) == 0, 'the case is not explained again'
    assert '0 differences' in capsys.readouterr().out
    fresh = record.with_name('fresh.jsonl')
    assert main([*words, '--json', str(fresh)]) == 1
    assert 'sinusoid 7: second recording, nominal: 60 -> ' in capsys.readouterr().out
    assert rows_of(fresh)['sinusoid', 7].concealed
