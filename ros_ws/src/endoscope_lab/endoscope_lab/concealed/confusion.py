"""What is confounded with what: injected laws, and the wrong names given or left open."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from endoscope_explain.prediction_set import NOTHING
from endoscope_lab.concealed.row import Row
from endoscope_lab.concealed.sets import JudgedContest
from endoscope_pages import render_page

_ROW, _LEFT, _RIGHT, _MARGIN = 22.0, 330.0, 620.0, 14.0
"""Heights and places in the picture, px."""


class Confusion(NamedTuple):
    """An injected law, and another name of the same joint."""

    truth: str
    name: str
    given: bool  # as the answer; otherwise left open beside the truth or another name


def confusions(rows: Sequence[Row]) -> Counter[Confusion]:
    """How often each was found in the rows."""
    return Counter(each for row in rows for each in _of_row(row))


def _of_row(row: Row) -> Iterator[Confusion]:
    for kept in row.contests:
        judged = JudgedContest.of_row(kept)
        laws = [law for law in row.concealed if law.partition('@')[2] in ('', judged.joint)]
        truth = ' + '.join(law.partition('@')[0] for law in laws) or NOTHING
        wrong = not judged.reported_is_right and not judged.is_of_function
        if wrong:
            yield Confusion(truth, judged.reported, True)
        left = judged.contest.left_open(judged.reported)
        for names, right in judged.statements:
            if names in left and not right and not (wrong and judged.reported in names):
                yield Confusion(truth, ' or '.join(names), False)


def page(rows: Sequence[Row]) -> str:
    """HTML with laws on the left and names on the right, joined as often as they are confounded."""
    counts = confusions(rows)
    truths, names = (sorted({each[side] for each in counts}) for side in (0, 1))

    def height(place: int) -> float:
        return _MARGIN + _ROW * (place + 0.5)

    lines = [
        {
            'y': height(truths.index(each.truth)),
            'to': height(names.index(each.name)),
            'width': 1.5 * count,
            'title': f'{each.truth}, {"called" if each.given else "or"} {each.name}: {count}',
            'given': each.given,
        }
        for each, count in sorted(counts.items())
    ]
    return render_page(
        'endoscope_lab',
        'concealed/templates/confusion.html.j2',
        cases=len(rows),
        strata=sorted({row.stratum for row in rows}),
        wrong=sum(count for each, count in counts.items() if each.given),
        lines=lines,
        truths=[(truth, height(k)) for k, truth in enumerate(truths)],
        names=[(name, height(k)) for k, name in enumerate(names)],
        left=_LEFT,
        right=_RIGHT,
        height=2.0 * _MARGIN + _ROW * max(len(truths), len(names), 1),
    )
