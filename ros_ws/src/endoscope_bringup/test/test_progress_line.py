"""What a long command says of its progress."""

import io

from endoscope_bringup.progress_line import ProgressLine


class Terminal(io.StringIO):
    """A stream that a person looks at."""

    def isatty(self):
        return True


def steps(stream):
    found = io.StringIO()
    with ProgressLine(4, 'reading', stream) as progress:
        progress.step('refitting')
        progress.step('audit: a remark')
        progress.step('searching')
        progress.print('found', file=found)
    return stream.getvalue(), found.getvalue()


def test_without_a_terminal_each_step_is_a_line():
    output, found = steps(io.StringIO())
    assert output == 'refitting\naudit: a remark\nsearching\n'
    assert found == 'found\n'


def test_in_a_terminal_a_bar_says_what_is_done_and_goes():
    output, found = steps(Terminal())
    drawn = output.split('\r\x1b[K')
    assert '[....................] 0 s  reading' in drawn
    assert '[#####...............] 0 s  refitting' in drawn
    assert 'audit: a remark\n' in drawn
    assert '[##########..........] 0 s  searching' in drawn
    assert drawn[-1] == ''
    assert found == 'found\n'


def test_with_shares_each_step_is_a_line_once():
    for stream in (io.StringIO(), Terminal()):
        with ProgressLine(stream=stream) as progress:
            for share in (0.2, 0.3, 0.5):
                progress.show('moving' if share < 0.5 else 'judging', share)
        output = stream.getvalue()
        if stream.isatty():
            assert '[######..............] 0 s  moving' in output
            assert '[##########..........] 0 s  judging' in output
        else:
            assert output == 'moving\njudging\n'
