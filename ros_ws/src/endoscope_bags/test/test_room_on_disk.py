"""Room is asked for before it is needed."""

import pytest

from endoscope_bags.chunk_sink import require_room
from endoscope_bags.errors import BagWriteError


def test_asking_leaves_the_file_as_it_was(tmp_path):
    with (tmp_path / 'file').open('wb', buffering=0) as file:
        file.write(b'abc')
        require_room(file.fileno(), 'file', 10_000)
        file.write(b'def')
    assert (tmp_path / 'file').read_bytes() == b'abcdef'


def test_more_than_any_disk_has_is_refused(tmp_path):
    with (tmp_path / 'file').open('wb', buffering=0) as file:
        with pytest.raises(BagWriteError, match=r'file: .*; recording ended there'):
            require_room(file.fileno(), 'file', 1 << 60)
        file.write(b'abc')
    assert (tmp_path / 'file').read_bytes() == b'abc'
