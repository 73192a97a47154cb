"""The ten packages say truly what they contain, need and may import."""

import ast
import importlib
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from configparser import ConfigParser
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
WORKSPACE = ROOT / 'ros_ws'
PACKAGES = sorted(path.parent for path in WORKSPACE.glob('src/*/package.xml'))
NOT_SOURCE = {'__pycache__', '.mypy_cache', '.pytest_cache', '.ruff_cache'}

# Names under which a distribution is imported, where they differ from its own.
IMPORT_NAMES = {
    'dynamixel-sdk': 'dynamixel_sdk',
    'foxglove-sdk': 'foxglove',
    'pyserial': 'serial',
    'pyyaml': 'yaml',
    'scikit-learn': 'sklearn',
}

each_package = pytest.mark.parametrize('package', PACKAGES, ids=lambda path: path.name)


def _imported_modules(folder: Path) -> dict[str, Path]:
    """Top-level names of absolute imports below `folder`, each with one file that has it."""
    found: dict[str, Path] = {}
    for path in folder.rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names = [node.module]
            else:
                continue
            for name in names:
                found.setdefault(name.split('.')[0], path.relative_to(ROOT))
    return found


def _declared(package: Path, *more: str) -> set[str]:
    """What the manifest declares under `depend`, `exec_depend` and `more` tags."""
    manifest = ElementTree.parse(package / 'package.xml').getroot()
    tags = ('depend', 'exec_depend', *more)
    return {str(element.text) for tag in tags for element in manifest.iter(tag)}


def _locked_modules() -> set[str]:
    settings = tomllib.loads((WORKSPACE / 'pyproject.toml').read_text())
    groups = settings['dependency-groups']
    wanted = ('viewers', 'train', 'pandas', 'lerobot')
    optional = [line for group in wanted for line in groups[group]]
    lines = settings['project']['dependencies'] + optional
    names = [re.split(r'[^\w-]', line, maxsplit=1)[0] for line in lines]
    return {IMPORT_NAMES.get(name, name) for name in names}


def _settings(package: Path) -> ConfigParser:
    settings = ConfigParser(interpolation=None)
    settings.read(package / 'setup.cfg', encoding='utf-8')
    return settings


def _entry_points(package: str) -> dict[str, str]:
    settings = _settings(WORKSPACE / 'src' / package)
    scripts = settings.get('options.entry_points', 'console_scripts', fallback='')
    return dict(line.split(' = ') for line in scripts.split('\n') if line)


def test_the_top_level_is_what_it_is_meant_to_be() -> None:
    listed = subprocess.run(
        ['git', 'ls-files'], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip('this is no git checkout, whose files could be listed')
    top = {line.split('/')[0] for line in listed.stdout.splitlines()}
    assert {name for name in top if not name.startswith('.')} == {
        *('ros_ws', 'docker', 'bags', 'tests', 'README.md', 'colcon.meta')
    }


def test_lock_files_pin_hashes_and_name_no_download_host() -> None:
    for path in WORKSPACE.glob('requirements*.lock'):
        lock = path.read_text()
        pinned = re.findall(r'^[\w.\[\]-]+==\S+', lock, flags=re.M)
        assert pinned
        assert len(pinned) == len(re.findall(r'^[\w.\[\]-]+.*\\\n +--hash=sha256:', lock, re.M)), (
            path
        )
        assert '://' not in lock
        assert '-url' not in lock


def test_colcon_takes_all_packages_as_ament_python() -> None:
    listed = subprocess.run(
        [sys.executable, '-m', 'colcon', '--log-base', '/dev/null', 'list', '--base-paths', 'src'],
        cwd=WORKSPACE,
        capture_output=True,
        text=True,
        check=True,
    )
    assert listed.stdout.splitlines() == [
        f'{package.name}\tsrc/{package.name}\t(ros.ament_python)' for package in PACKAGES
    ]
    assert len(PACKAGES) == 10


BUILD = """
import os, runpy, sys
out, *packages = sys.argv[1:]
for package in packages:
    os.chdir(package)
    to = f'{out}/{os.path.basename(package)}'
    os.mkdir(to)
    sys.argv = ['setup.py', '-q', 'egg_info', '--egg-base', to, 'build_py', '--build-lib']
    sys.argv += [f'{to}/lib', 'install_data', '--install-dir', to]
    runpy.run_path('setup.py', run_name='__main__')
"""


@pytest.fixture(scope='module')
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp('installed')
    command = [sys.executable, '-c', BUILD, str(out), *map(str, PACKAGES)]
    subprocess.run(command, capture_output=True, text=True, check=True)
    return out


@each_package
def test_everything_in_the_package_and_its_licence_are_installed(
    package: Path, installed: Path
) -> None:
    out = installed / package.name
    built = {path.relative_to(out / 'lib') for path in (out / 'lib').rglob('*') if path.is_file()}
    sources = {
        path.relative_to(package)
        for path in (package / package.name).rglob('*')
        if path.is_file() and not NOT_SOURCE & set(path.parts)
    }
    assert built == sources, (
        'a folder without __init__.py, or a suffix that setup.cfg does not ship'
    )
    licence = out / 'share' / package.name / 'LICENSE'
    assert licence.read_text() == (WORKSPACE / 'LICENSE').read_text()


def test_one_version_is_named_everywhere() -> None:
    project = tomllib.loads((WORKSPACE / 'pyproject.toml').read_text())['project']
    citation = yaml.safe_load((WORKSPACE / 'CITATION.cff').read_text())
    manifests = [ElementTree.parse(package / 'package.xml') for package in PACKAGES]
    assert {str(manifest.findtext('version')) for manifest in manifests} == {project['version']}
    assert citation['version'] == project['version']
    changes = re.findall(r'^## (\d\S+)', (WORKSPACE / 'CHANGELOG.md').read_text(), flags=re.M)
    assert changes[0] == project['version']


def test_the_citation_has_what_cff_asks_for() -> None:
    citation = yaml.safe_load((WORKSPACE / 'CITATION.cff').read_text())
    assert citation['cff-version'] == '1.2.0'
    for cited in (citation, *citation['references']):
        assert cited['title']
        assert cited['authors']
        assert all('name' in person or 'family-names' in person for person in cited['authors'])
    assert len(citation['references']) == 2
    assert {reference['type'] for reference in citation['references']} == {'article'}


@each_package
def test_manifests_agree(package: Path) -> None:
    manifest = ElementTree.parse(package / 'package.xml').getroot()
    settings = _settings(package)
    assert manifest.findtext('name') == package.name
    for key in ('name', 'version', 'license', 'description'):
        assert settings['metadata'][key] == manifest.findtext(key)
    assert (package / 'resource' / package.name).exists()
    assert settings['install']['install_scripts'] == f'$base/lib/{package.name}'


@each_package
def test_imports_are_declared(package: Path) -> None:
    known = _locked_modules() | set(sys.stdlib_module_names) | _declared(package) | {package.name}
    undeclared = {
        f'{name} ({path})'
        for name, path in _imported_modules(package / package.name).items()
        if name not in known
    }
    assert not undeclared, 'neither in package.xml nor in pyproject.toml'
    imported = _imported_modules(package / 'test')
    by_tests = {name for name in imported if name.startswith('endoscope_')}
    assert by_tests <= _declared(package, 'test_depend') | {package.name}


@each_package
def test_entry_points_can_be_called(package: Path) -> None:
    for target in _entry_points(package.name).values():
        module, function = target.split(':')
        assert callable(getattr(importlib.import_module(module), function))
