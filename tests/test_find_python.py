"""Set-up finds a Python 3.12, or says in one line what to install."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FIND_PYTHON = Path(__file__).parents[1] / 'ros_ws' / 'scripts' / 'find_python'


def _find(home: Path, *arguments: str, **environment: str) -> tuple[int, str]:
    """Run the script where nothing but the given environment leads to a Python."""
    tools = home / 'tools'
    tools.mkdir(exist_ok=True)
    for tool in ('bash', 'env'):
        if not (tools / tool).exists():
            (tools / tool).symlink_to(f'/usr/bin/{tool}')
    environment['PATH'] = os.pathsep.join(filter(None, [environment.get('PATH'), str(tools)]))
    done = subprocess.run(
        [str(FIND_PYTHON), *arguments],
        env={'HOME': str(home), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ''
    assert done.stdout.count('\n') == 1
    return done.returncode, done.stdout.strip()


def _fake_python(path: Path, body: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'#!/bin/bash\n{body}\n')
    path.chmod(0o755)
    return path


needs_no_system_python = pytest.mark.skipif(
    Path('/usr/bin/python3.12').exists() or Path('/usr/local/bin/python3.12').exists(),
    reason='a Python 3.12 of the system is always found and cannot be missing',
)


def test_python_on_the_path_is_found(tmp_path: Path) -> None:
    (tmp_path / 'bin').mkdir()
    (tmp_path / 'bin' / 'python3.12').symlink_to(Path(sys.executable).resolve())
    status, found = _find(tmp_path, PATH=str(tmp_path / 'bin'))
    assert status == 0
    assert Path(found).is_absolute()


def test_shim_that_fails_gives_way_to_the_version_behind_it(tmp_path: Path) -> None:
    _fake_python(tmp_path / 'shims' / 'python3.12', 'echo not chosen >&2; exit 127')
    version = tmp_path / '.pyenv' / 'versions' / '3.12.1' / 'bin' / 'python3.12'
    _fake_python(version, f'exec {Path(sys.executable).resolve()} "$@"')
    status, found = _find(tmp_path, PATH=str(tmp_path / 'shims'))
    assert status == 0
    assert found == str(Path(sys.executable).resolve())


def test_python_that_was_named_is_not_replaced_by_another(tmp_path: Path) -> None:
    named = _fake_python(tmp_path / 'python3.9', 'exit 5')
    status, line = _find(tmp_path, PYTHON=str(named), PATH=str(Path(sys.executable).parent))
    assert status == 1
    assert line == f'PYTHON={named} is not a Python 3.12'


@needs_no_system_python
@pytest.mark.parametrize(
    ('status', 'arguments', 'said'),
    [
        (None, (), 'Python 3.12 is not on this machine: apt install python3.12'),
        (3, (), '/opt/python3.12 has no venv module: apt install python3.12-venv'),
        (4, ('ros',), 'install ros-jazzy-rclpy'),
    ],
)
def test_what_is_missing_is_said_in_one_line(tmp_path: Path, status, arguments, said) -> None:
    if status is not None:
        _fake_python(tmp_path / 'bin' / 'python3.12', f'echo /opt/python3.12; exit {status}')
    failed, line = _find(tmp_path, *arguments, ROS_DISTRO='jazzy', PATH=str(tmp_path / 'bin'))
    assert failed == 1
    assert said in line
