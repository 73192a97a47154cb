"""Commands of `endoscope` that other packages bring: entry points of one group."""

import os
import re
import sys

GROUP = 'endoscope.commands'
"""An entry point of it names a module of the same form as those of `endoscope_bringup.commands`."""
COMES_WITH = {
    'bench': 'endoscope_benchmarks',
    'console': 'endoscope_console',
    'prove': 'endoscope_benchmarks',
}
"""Packages of this workspace that may be left out, by the command that is missing then."""

_SECTION = re.compile(rf'^\[{re.escape(GROUP)}\]\n((?:[^\[\n].*\n?|\n)*)', re.MULTILINE)
_ENTRY = re.compile(r'^(\S+) *= *([\w.]+) *$', re.MULTILINE)


def commands_of_other_packages() -> dict[str, str]:
    """Find module names by command in `entry_points.txt` of all installed packages, sorted."""
    found: dict[str, str] = {}
    # `importlib.metadata` finds the same, but takes ten times as long, at every start.
    for folder in sys.path:
        try:
            with os.scandir(folder or os.curdir) as entries:
                installed = [
                    e.path for e in entries if e.name.endswith(('.dist-info', '.egg-info'))
                ]
        except OSError:  # an archive, or a folder that is not there
            continue
        for package in installed:
            for command, module in _entries(f'{package}/entry_points.txt'):
                # Of two packages with the same command the one that stands first in `sys.path`
                # counts.
                found.setdefault(command, module)
    return dict(sorted(found.items()))


def _entries(path: str) -> list[tuple[str, str]]:
    try:
        with open(path, encoding='utf-8') as file:  # noqa: PTH123 - of hundreds of files
            text = file.read()
    except OSError:  # a package without entry points
        return []
    section = _SECTION.search(text)
    return _ENTRY.findall(section[1]) if section else []
