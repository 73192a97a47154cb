"""The pages of the documentation, their fenced blocks, and running what they show."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from endoscope_nodes.runtime.private_domain import private_domain

ROOT = Path(__file__).parents[1]
WORKSPACE = ROOT / 'ros_ws'
PAGES = sorted(
    {
        *(ROOT.glob('*.md')),
        *(ROOT / 'bags').glob('*.md'),
        *WORKSPACE.glob('*.md'),
        *(WORKSPACE / 'doc').glob('*.md'),
        *(WORKSPACE / 'doc/reference').glob('*.md'),
    }
)

LANGUAGES = {'console', 'python', 'yaml', 'json', 'text', 'xml'}
NOT_RUN = {
    'long': 'takes minutes, and is run by the checks before a merge',
    'hardware': 'needs a real instrument, or stays at the terminal as one does',
    'interactive': 'needs a person at the keyboard',
    'ros2': 'needs a sourced ROS 2',
    'docker': 'needs a container engine',
    'yours': 'needs recordings that are yours',
}
"""Words after the language with which a block is not run, and why."""

_DATE = r'20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d'
_FENCE = re.compile(r'^(`{3,})([^`\n]*)\n(.*?)^\1$', re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Command:
    """A command of a console block, and what the page shows of its output."""

    text: str
    shown: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Block:
    """A fenced block: language, the words after it, text, and the line where it stands."""

    language: str
    words: tuple[str, ...]
    text: str
    line: int

    @property
    def name(self) -> str:
        """Name of the file that the page asks to save, or nothing."""
        return next((word for word in self.words if '.' in word), '')

    @property
    def is_run(self) -> bool:
        return not set(self.words) & NOT_RUN.keys()

    def commands(self) -> list[Command]:
        found: list[Command] = []
        for line in self.text.splitlines():
            if line.startswith('$ '):
                found.append(Command(line[2:]))
            elif found and found[-1].text.endswith('\\'):
                found[-1] = Command(f'{found[-1].text}\n{line}')
            elif found:
                found[-1].shown.append(line)
        return found


def blocks(page: Path) -> Iterator[Block]:
    """Yield the fenced blocks of a page in order, directives left out."""
    text = page.read_text(encoding='utf-8')
    for fence in _FENCE.finditer(text):
        language, *words = fence[2].split() or ['']
        if not language.startswith('{'):
            yield Block(language, tuple(words), fence[3], text.count('\n', 0, fence.start()) + 1)


def prose(page: Path) -> str:
    """Return a page without its fenced blocks."""
    return _FENCE.sub('', page.read_text(encoding='utf-8'))


def run_page(page: Path, folder: Path) -> None:
    """Run what a page shows, in its order, in `folder`, and compare the output that it shows."""
    environment = os.environ | {
        'PATH': f'{Path(sys.executable).parent}:{os.environ["PATH"]}',
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(private_domain()),
        'NO_COLOR': '1',
        'COLUMNS': '100',
    }
    background: list[subprocess.Popen] = []
    try:
        for block in blocks(page):
            where = f'{page.name}:{block.line}'
            if not block.is_run:
                continue
            if block.name:
                (folder / block.name).write_text(block.text)
            elif block.language == 'python':
                _run([sys.executable, '-c', block.text], folder, environment, where)
            elif block.language == 'console' and 'background' in block.words:
                for command in block.commands():
                    background.append(_start(command, page, folder, environment))
            elif block.language == 'console':
                for command in block.commands():
                    output = _run(['bash', '-c', command.text], folder, environment, where)
                    _compare(command, output, where)
    finally:
        for process in background:
            process.send_signal(signal.SIGINT)
        for process in background:
            process.communicate(timeout=60)
    assert [process.returncode for process in background] == [0] * len(background)


def _run(words: list[str], folder: Path, environment: dict[str, str], where: str) -> str:
    done = subprocess.run(
        words,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, (
        f'{where}: {words[-1]}\nexit status {done.returncode}\n{done.stdout}'
    )
    return done.stdout


def _start(
    command: Command, page: Path, folder: Path, environment: dict[str, str]
) -> subprocess.Popen:
    """Start a command, and wait until it has said what the page shows."""
    # Pages are about what a graph says and does, which a tenth of its ticks shows as well.
    cheap = ' --ros-args -p tick_rate:=100' if command.text.split()[0] == 'graph' else ''
    # The whole calibration is run by the page that shows its whole answer.
    cheap += ' -p calibration:motion:=brief' if cheap and page.stem != 'README' else ''
    process = subprocess.Popen(
        ['bash', '-c', f'exec {command.text}{cheap}'],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    said = ''
    assert command.shown, f'{command.text}: show the line by which one sees that it is ready'
    while not pattern(command.shown).search(said):
        line = process.stdout.readline()
        assert line, f'{command.text} ended:\n{said}'
        said += line
    return process


def _compare(command: Command, output: str, where: str) -> None:
    if command.shown:
        assert pattern(command.shown).fullmatch(output.rstrip()), (
            f'{where}: $ {command.text}\nshows\n' + '\n'.join(command.shown) + f'\nsays\n{output}'
        )


def pattern(shown: list[str]) -> re.Pattern:
    """Return what output has to match: `...` stands for anything, a date for any date."""
    forms = [
        '.*' if piece == '...' else _DATE if re.fullmatch(_DATE, piece) else re.escape(piece)
        for piece in re.split(rf'(\.\.\.|{_DATE})', '\n'.join(shown).rstrip())
    ]
    return re.compile(''.join(forms), re.DOTALL)
