"""What was measured, one record each in `records`, as the tables that pages show of it.

A record has `command`, `date`, `machine`, `seeds`, `columns`, `rows` and often `notes`. One with
a `question` and a `figure` is a row of `how_well_it_works.md`; `shown` renames columns of a table.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / 'records'


def record(name: str) -> dict[str, Any]:
    return json.loads((FOLDER / f'{name}.json').read_text(encoding='utf-8'))


def answers(*names: str) -> Iterator[list[str]]:
    """Yield heading and rows: of each record its question, figure, origin and command."""
    yield ['question', 'figure', 'aim', 'measured', 'again']
    for name in names:
        one = record(name)
        seeds = f'seeds {one["seeds"]}' if one['seeds'] else ''
        yield [
            f'[{one["question"]}](records/{name}.json)',
            one['figure'],
            one.get('aim', ''),
            '; '.join(filter(None, (one['date'], seeds, one['machine']))),
            f'`{one["command"]}`' if one['command'] else 'by a program of the history',
        ]


def table(name: str) -> Iterator[list[str]]:
    """Yield heading and rows of one record, of the columns that it wants shown."""
    one = record(name)
    shown = one.get('shown') or {column: column for column in one['columns']}
    yield list(shown.values())
    places = [one['columns'].index(column) for column in shown]
    for row in one['rows']:
        yield [str(row[place]) for place in places]


TABLES = {'answers': answers, 'table': table}
