"""Which recordings are in a folder: `endoscope bag list`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from endoscope_bags.chunk_sink import is_being_written
from endoscope_bags.errors import BagError, BagNotFoundError
from endoscope_bags.event_bag import Event, events_of
from endoscope_bags.mcap_records import McapSummary, read_summary
from endoscope_bags.metadata import SQLITE3, bag_files
from endoscope_bags.recording import open_bag
from endoscope_core.errors import EndoscopeError, printable

RECORDING = 'recording'
BEING_RECORDED = 'being recorded'
_SUFFIXES = ('.mcap', SQLITE3)


@dataclass(frozen=True)
class BagEntry:
    """One recording of a folder."""

    name: str  # of its folder or file
    kind: str  # of its first event, `fault` or `mark`; else `recording`
    start_ns: int  # first receipt, since the epoch; 0 where it cannot be read
    duration_s: float
    size: int  # bytes
    events: tuple[Event, ...]  # why it was kept
    trouble: str  # why it cannot be read, that it was cut off, or `BEING_RECORDED`; else empty

    def as_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {**vars(self), 'events': [vars(event) for event in self.events]}

    def lines(self) -> list[str]:
        """Return it as text: one line, and one for each event or error."""
        second = np.datetime64(self.start_ns, 'ns').astype('datetime64[s]')
        begin = f'{second} UTC' if self.start_ns else '-'
        size = f'{self.duration_s:10.3f} s  {self.size / 1e6:9.2f} MB'
        text = [f'{self.kind:9}  {begin:23}  {size}  {self.name}']
        text += [f'    {event}' for event in self.events]
        return text + ([f'    {self.trouble}'] if self.trouble else [])


def bags_in(folder: Path) -> list[BagEntry]:
    """List all recordings of a folder, oldest first, an unreadable one with its error.

    Of a finished one only the summary is read. BagNotFoundError if there is no such folder.
    """
    if not folder.is_dir():
        raise BagNotFoundError(f'{folder}: no such folder')
    entries = [_entry(path) for path in sorted(folder.iterdir()) if _is_bag(path)]
    return sorted(entries, key=lambda entry: entry.start_ns)


def _is_bag(path: Path) -> bool:
    if path.name.startswith('.'):
        return False
    if path.is_dir():
        return any(file.suffix in _SUFFIXES for file in path.iterdir())
    return path.suffix in _SUFFIXES


def _entry(path: Path) -> BagEntry:
    trouble, size, being_recorded = '', 0, False
    try:
        files = bag_files(path)
        size = sum(file.stat().st_size for file in files)
        being_recorded = any(map(is_being_written, files))
        summary = _summary(files)
        if summary is None:
            summary, trouble = _read_whole(path)
    except (EndoscopeError, OSError) as error:
        trouble = BEING_RECORDED if being_recorded else str(error)
        return BagEntry(path.name, RECORDING, 0, 0.0, size, (), trouble)
    events = tuple(events_of(summary.metadata))
    return BagEntry(
        path.name,
        events[0].kind if events else RECORDING,
        summary.start_ns,
        (summary.end_ns - summary.start_ns) * 1e-9,
        size,
        events,
        BEING_RECORDED if being_recorded else trouble,
    )


def _summary(files: Sequence[Path]) -> McapSummary | None:
    """Combined summary of all files; None where one has none."""
    summaries = [read_summary(file) for file in files]
    found = [each for each in summaries if each is not None]
    if len(found) < len(files):
        return None
    return McapSummary(
        min(each.start_ns for each in found),
        max(each.end_ns for each in found),
        {name: content for each in found for name, content in each.metadata.items()},
    )


def _read_whole(path: Path) -> tuple[McapSummary, str]:
    """Summary of a recording without one, and its error."""
    trouble = ''
    try:
        recording = open_bag(path)
    except BagError as error:
        # A recorder that was killed has left the reason of an event, and the messages before it.
        trouble = str(error)
        recording = open_bag(path, salvage=True)
    return McapSummary(recording.start_ns, recording.end_ns, recording.metadata), trouble


def listing(folder: Path, entries: Sequence[BagEntry]) -> str:
    """Return the entries as text."""
    if not entries:
        return printable(f'{folder}: no recording')
    return '\n'.join(printable(line) for entry in entries for line in entry.lines())
