"""Ways to spoil bytes and texts, drawn at random."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

BOUNDARIES = tuple(
    n for k in (7, 8, 15, 16, 31, 32, 34, 62, 63, 64) for n in (2**k - 1, 2**k) if n < 2**64
)
EVIL_NAMES = (
    '\x1b[2J\x1b]0;owned\x07',
    '\x9b31m',
    '\u202egnp.exe',
    '<script>alert(1)</script>',
    '/a\n/b',
    '',
    '\x00',
    '../../etc/passwd',
    'n' * 70000,
)
EVIL_SCALARS = (
    '1e308',
    '-1e308',
    '1e400',
    '.nan',
    '.inf',
    '-.inf',
    '-1',
    '0',
    str(2**63),
    str(2**64),
    '9' * 5000,
    '1:' * 3000 + '1',
    '2024-13-01',
    '2024-02-30T25:61:61Z',
    '0x' + 'f' * 5000,
    '[' * 5000,
    '{a: ' * 500,
    '*anchor',
    '&anchor [1, 2]',
    '!!python/object/apply:os.system [true]',
    '!!binary gA==',
    '<<',
    'null',
    'true',
    '[]',
    '{}',
    '{a: 1, a: 2}',
    '? [a]\n: b',
    '"\\x1b[2J"',
    '<b>name</b>',
    "''",
    'x' * 100000,
)


def spoiled_bytes(data: bytes, rng: Generator) -> bytes:
    """Bytes that a disk, a cable or a crash may leave: cut, flipped, moved, emptied."""
    ways = (_cut, _flip, _flip, _flip, _delete, _insert, _empty)
    return bytes(ways[rng.integers(len(ways))](bytearray(data), rng))


def flipped(data: bytes, rng: Generator) -> tuple[bytes, list[int]]:
    """The bytes with one to 200 others among them, and where those are."""
    changed = bytearray(data)
    places = rng.integers(0, len(data), size=int(2.0 ** rng.uniform(0.0, 7.7)))
    for place in places:
        changed[place] = (changed[place] + int(rng.integers(1, 256))) % 256
    return bytes(changed), [p for p in places.tolist() if changed[p] != data[p]]


def _cut(data: bytearray, rng: Generator) -> bytearray:
    return data[: rng.integers(len(data) + 1)]


def _flip(data: bytearray, rng: Generator) -> bytearray:
    return bytearray(flipped(bytes(data), rng)[0]) if data else data


def _span(data: bytearray, rng: Generator) -> slice:
    start = int(rng.integers(len(data) + 1))
    return slice(start, start + int(2.0 ** rng.uniform(0.0, 12.0)))


def _delete(data: bytearray, rng: Generator) -> bytearray:
    del data[_span(data, rng)]
    return data


def _insert(data: bytearray, rng: Generator) -> bytearray:
    place = int(rng.integers(len(data) + 1))
    data[place:place] = data[_span(data, rng)]
    return data


def _empty(data: bytearray, rng: Generator) -> bytearray:
    span = _span(data, rng)
    data[span] = bytes(len(data[span]))
    return data


def spoiled_table(text: str, rng: Generator, delimiter: str) -> bytes:
    """A text table with other cells, lines or bytes."""
    return _repeatedly(text, rng, (_line_way, lambda t, r: _cell(t, r, delimiter)))


def spoiled_yaml(text: str, rng: Generator) -> bytes:
    """A YAML text with other values, keys, lines or bytes."""
    return _repeatedly(text, rng, (_line_way, _value, _value, _aliases))


def _repeatedly(
    text: str, rng: Generator, ways: tuple[Callable[[str, Generator], str], ...]
) -> bytes:
    for _ in range(rng.integers(1, 4)):
        text = ways[rng.integers(len(ways))](text, rng)
    data = text.encode(errors='surrogatepass')
    return spoiled_bytes(data, rng) if rng.random() < 0.25 else data


def _line_way(text: str, rng: Generator) -> str:
    lines = text.split('\n')
    k, other = rng.integers(len(lines), size=2)
    way = rng.integers(5)
    if way == 0:
        lines.insert(k, lines[other])
    elif way == 1:
        del lines[k]
    elif way == 2:
        lines[k], lines[other] = lines[other], lines[k]
    elif way == 3:
        lines[k] = ' ' * int(rng.integers(1, 9)) + lines[k]
    else:
        lines[k] += rng.choice(EVIL_NAMES)
    return '\n'.join(lines)


def _value(text: str, rng: Generator) -> str:
    lines = text.split('\n')
    k = int(rng.integers(len(lines)))
    key, colon, value = lines[k].partition(':')
    evil = str(rng.choice(EVIL_SCALARS))
    if rng.random() < 0.2:
        key = key[: len(key) - len(key.lstrip(' -'))] + evil
    else:
        value = ' ' + evil
    lines[k] = key + (colon or ':') + value
    return '\n'.join(lines)


def _aliases(text: str, rng: Generator) -> str:
    levels = int(rng.integers(2, 30))
    bomb = ['a0: &a0 [x, x, x, x, x, x, x, x, x]']
    bomb += [f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * 9)}]' for k in range(1, levels)]
    return text + '\n' + '\n'.join(bomb)


def _cell(text: str, rng: Generator, delimiter: str) -> str:
    lines = text.split('\n')
    k = int(rng.integers(len(lines)))
    cells = lines[k].split(delimiter)
    cells[rng.integers(len(cells))] = str(rng.choice((*EVIL_SCALARS, *EVIL_NAMES)))
    lines[k] = delimiter.join(cells)
    return '\n'.join(lines)


def boundary(rng: Generator) -> int:
    """A number where counters, signs and allocations turn."""
    return int(rng.choice(np.array(BOUNDARIES, dtype=np.uint64)))
