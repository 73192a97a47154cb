"""Outputs appear whole or not at all, and never over something that is there."""

from pathlib import Path

import pytest

from endoscope_core.atomic_output import (
    atomic_directory,
    atomic_file,
    require_free_directory,
    with_final_names,
    write_text,
)
from endoscope_core.errors import OutputError


def test_what_is_written_has_the_name_that_a_person_will_find(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with atomic_directory(tmp_path / 'demo') as partial:
        told = with_final_names(f'recording to {partial / "bag"}')
        assert told == f'recording to {tmp_path / "demo" / "bag"}'
    with atomic_file('report.json') as partial:
        assert with_final_names(f'bag:={partial}') == 'bag:=report.json'
        partial.touch()


def test_file_takes_its_name_only_when_the_block_ends(tmp_path):
    target = tmp_path / 'made' / 'report.json'
    with atomic_file(target) as partial:
        partial.write_text('whole')
        assert not target.exists()
        assert partial.suffix == '.json'
    assert target.read_text() == 'whole'
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize('error', [RuntimeError, KeyboardInterrupt, SystemExit])
def test_failed_block_keeps_the_old_file_and_leaves_nothing(tmp_path, error):
    target = tmp_path / 'plant.yaml'
    target.write_text('old')
    with pytest.raises(error), atomic_file(target) as partial:
        partial.write_text('half')
        raise error
    assert target.read_text() == 'old'
    assert list(tmp_path.iterdir()) == [target]


def test_file_is_not_overwritten_when_that_is_refused(tmp_path):
    target = tmp_path / 'a.txt'
    write_text(target, 'old')
    with pytest.raises(OutputError, match=r'a\.txt exists already'):
        write_text(target, 'new', overwrite=False)
    assert target.read_bytes() == b'old'
    write_text(target, 'τ')
    assert target.read_bytes() == 'τ'.encode()
    with pytest.raises(OutputError, match='is a folder'):
        write_text(tmp_path, 'text')


@pytest.mark.parametrize('exists', [False, True])
def test_directory_appears_whole(tmp_path, exists):
    target = tmp_path / 'bag'
    if exists:
        target.mkdir()
    with atomic_directory(target) as partial:
        (partial / 'metadata.yaml').write_text('x')
        assert not (target / 'metadata.yaml').exists()
    assert (target / 'metadata.yaml').read_text() == 'x'
    assert list(tmp_path.iterdir()) == [target]


def test_failed_directory_leaves_nothing(tmp_path):
    with pytest.raises(RuntimeError), atomic_directory(tmp_path / 'bag') as partial:
        (partial / 'half').write_text('x')
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_taken_folder_is_refused_and_kept(tmp_path):
    (tmp_path / 'kept').write_text('x')
    with pytest.raises(OutputError, match='is not empty'), atomic_directory(tmp_path):
        pytest.fail('the block must not run')
    with pytest.raises(OutputError, match='is a file'):
        require_free_directory(tmp_path / 'kept')
    assert (tmp_path / 'kept').read_text() == 'x'


def test_a_folder_that_nothing_can_be_made_in_is_refused_beforehand(tmp_path):
    (tmp_path / 'file').touch()
    for place in (tmp_path / 'file' / 'out', Path('/proc/out')):
        with pytest.raises(OutputError, match=f'{place} cannot be created'):
            require_free_directory(place)
    require_free_directory(tmp_path / 'new' / 'newer')
    assert [path.name for path in tmp_path.iterdir()] == ['file']
