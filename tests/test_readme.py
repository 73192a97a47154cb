"""The README lists the commands and targets that there are, and no others."""

import re
import subprocess
from pathlib import Path

from endoscope_bringup.commands import COMMANDS

ROOT = Path(__file__).parents[1]
README = (ROOT / 'README.md').read_text(encoding='utf-8')


def test_commands_are_those_of_the_program() -> None:
    listed = set(re.findall(r'`endoscope ([a-z-]+)', README))
    assert listed == {name.rstrip('_').replace('_', '-') for name in COMMANDS}


def test_targets_are_those_of_the_makefile() -> None:
    listed = subprocess.run(
        ['make', '-C', 'ros_ws', 'help'], cwd=ROOT, capture_output=True, text=True, check=True
    )
    targets = {line.split()[0] for line in listed.stdout.splitlines()}
    named = set(re.findall(r'make -C ros_ws ([a-z-]+)', README))
    assert named
    assert named <= targets
    assert {'demo', 'test'} <= named


def test_links_lead_to_files() -> None:
    links = re.findall(r'\]\((?!https?:|#)([^)]+)\)', README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []
