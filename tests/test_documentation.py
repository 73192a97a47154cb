"""What README and pages say is so: links, commands, files and everything that can be run."""

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest
import yaml
from doc_pages import LANGUAGES, NOT_RUN, PAGES, ROOT, WORKSPACE, blocks, pattern, prose, run_page

from endoscope_bringup.commands import COMMANDS
from endoscope_bringup.subcommands import commands_of_other_packages
from endoscope_core.physics import JointParameters, SensorParameters
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_explain.report.sentences import EVIDENCE
from endoscope_explain.report.writing import KEYS
from endoscope_nodes import program
from endoscope_nodes.runtime.node_parameters import OF_NODE, OF_PROCESS
from endoscope_nodes.runtime.parameters import described
from endoscope_nodes.services import SERVICES
from endoscope_nodes.topics import TOPICS

ENDOSCOPE = {*COMMANDS, *commands_of_other_packages()}
API = {
    'api_core': ('endoscope_core', ('.physics', '.control', '.signals', '.safety')),
    'api_bags': ('endoscope_bags', ('',)),
    'api_devices': ('endoscope_devices', ('.load_cells', '.em_tracker')),
    'api_explain': ('endoscope_explain', ('',)),
}
"""Pages of what packages export, with modules that they have to name."""
TUTORIAL = WORKSPACE / 'doc/tutorial.md'
DAILY = ('README', 'explaining', 'plant_file')
"""Pages that are run for every change; the others show more of the same graph."""

each_page = pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def _slug(heading: str) -> str:
    """Return the anchor that GitHub and MyST give a heading."""
    return re.sub(r'[^\w\- ]', '', heading.strip().lower()).replace(' ', '-')


def test_readme_can_be_read_in_one_go() -> None:
    assert len((ROOT / 'README.md').read_text().splitlines()) <= 200


@each_page
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r'\]\((?!https?:)([^)]+)\)', prose(page)):
        path, _, anchor = target.partition('#')
        file = page.parent / path if path else page
        assert file.exists(), target
        if anchor:
            headings = re.findall(r'^#+ (.+)$', prose(file), flags=re.M)
            assert anchor in map(_slug, headings), target


@each_page
def test_blocks_say_what_they_are(page: Path) -> None:
    for block in blocks(page):
        where = f'line {block.line}'
        assert block.language in LANGUAGES, where
        assert set(block.words) <= {*NOT_RUN, 'background', block.name}, where
        if block.language == 'console':
            assert block.commands(), f'{where}: no line begins with "$ "'
            if 'ros2 ' in block.text and block.is_run:
                pytest.fail(f'{where}: a command of a sourced ROS 2 is not marked')
        if block.language == 'yaml':
            assert isinstance(yaml.safe_load(block.text), dict), where
    indented = re.findall(r'\n\n( {4}.*)', prose(page))
    assert indented == [], 'put it into a fence, which says what it is'


# The changelog names what has left, too.
@pytest.mark.parametrize('page', [page for page in PAGES if page.stem != 'CHANGELOG'])
def test_commands_and_targets_are_there(page: Path) -> None:
    text = page.read_text(encoding='utf-8')
    named = set(re.findall(r'(?:`|\$ )endoscope ([a-z]+)', text))
    assert named <= ENDOSCOPE
    makefile = (WORKSPACE / 'Makefile').read_text()
    targets = set(re.findall(r'^([a-z-]+):', makefile, flags=re.M))
    assert set(re.findall(r'make -C ros_ws ([a-z-]+)', text)) <= targets


def test_readme_names_every_command() -> None:
    named = re.findall(r'`endoscope ([a-z]+)', (ROOT / 'README.md').read_text())
    assert set(named) >= ENDOSCOPE


@pytest.mark.parametrize(
    'page',
    [
        pytest.param(
            page,
            id=str(page.relative_to(ROOT)),
            marks=() if page.stem in DAILY else pytest.mark.nightly,
        )
        for page in PAGES
        if page != TUTORIAL
        and any(b.language in ('console', 'python') and b.is_run for b in blocks(page))
    ],
)
@pytest.mark.timeout(600)
def test_what_a_page_shows_runs(page: Path, tmp_path: Path) -> None:
    run_page(page, tmp_path)


def test_a_date_that_is_shown_stands_for_dates_alone() -> None:
    shown = pattern(['recording  2026-11-29T02:16:16 UTC ... bag'])
    assert shown.fullmatch('recording  2031-01-02T03:04:05 UTC  9.0 s  bag')
    assert not shown.fullmatch('recording  56910064228-01-02T03:04:05 UTC  9.0 s  bag')
    assert not shown.fullmatch('recording  2237-01-02T03:04:05 UTC  9.0 s  bag')


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site as `make -C ros_ws doc` builds it; a warning fails the build."""
    out = tmp_path_factory.mktemp('site')
    recipe = re.search(r'-m (sphinx .*) doc build/doc/html', (WORKSPACE / 'Makefile').read_text())
    assert recipe
    built = subprocess.run(
        [sys.executable, '-m', *recipe[1].split(), '-d', out / 'trees', 'doc', out / 'html'],
        cwd=WORKSPACE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout
    return out / 'html'


def test_the_site_needs_no_network(site: Path) -> None:
    for page in site.rglob('*.html'):
        text = page.read_text(encoding='utf-8')
        assert re.findall(r'<(?:script|img|iframe)[^>]* src="https?://[^"]*"', text) == [], page
        assert re.findall(r'<link rel="stylesheet"[^>]* href="https?://[^"]*"', text) == [], page


def test_pages_keep_what_the_code_says(tmp_path: Path) -> None:
    for room in ('doc', 'security'):
        shutil.copytree(WORKSPACE / room, tmp_path / room)
    script = [sys.executable, tmp_path / 'doc/reference_pages.py']
    subprocess.run(script, check=True, env=os.environ | {'COLUMNS': '30'})
    stale = [
        str(page.relative_to(tmp_path))
        for page in sorted(tmp_path.rglob('*'))
        if page.suffix in ('.md', '.xml')
        and page.read_text() != (WORKSPACE / page.relative_to(tmp_path)).read_text()
    ]
    assert stale == [], 'run `make -C ros_ws reference` and commit what it writes'


def test_records_are_whole_and_reached_from_the_pages() -> None:
    files = sorted((WORKSPACE / 'doc/records').glob('*.json'))
    text = ''.join(page.read_text(encoding='utf-8') for page in PAGES)
    assert len(files) > 30
    for file in files:
        record = json.loads(file.read_text(encoding='utf-8'))
        assert record.keys() >= {'command', 'date', 'machine', 'seeds', 'columns', 'rows'}, file
        assert record['rows'], file
        assert {len(row) for row in record['rows']} == {len(record['columns'])}, file
        assert record.get('shown', {}).keys() <= set(record['columns']), file
        assert bool(record.get('question')) == bool(record.get('figure')), file
        assert f'(records/{file.name})' in text or f'table:{file.stem} ' in text, file


def test_a_question_has_a_figure_on_few_lines() -> None:
    page = (WORKSPACE / 'doc/how_well_it_works.md').read_text(encoding='utf-8')
    assert len(page.splitlines()) <= 200


def test_the_interface_that_others_rely_on_stands_in_the_reference() -> None:
    topics, report = (
        (WORKSPACE / f'doc/reference/{page}.md').read_text() for page in ('topics', 'report')
    )
    for name in (
        *('motor/setpoint_js', 'rig/kind', 'recorder/mark', 'watch/restart'),
        *('compensator/adopt', 'compensator/plant', 'calibration/feedback', 'calibration/numbers'),
    ):
        assert f'| `{name}` | ' in topics, name
    assert '| `rig` | ' in report


def test_reference_pages_can_be_read_without_the_site() -> None:
    pages = sorted((WORKSPACE / 'doc/reference').glob('*.md'))
    text = {page.stem: page.read_text(encoding='utf-8') for page in pages}
    for page, content in text.items():
        # The site alone has what autodoc writes; a table names it in the page as well.
        directives = set(re.findall(r'^```\{([\w-]+)\}', content, flags=re.M))
        assert directives <= ({'toctree'} if page == 'index' else {'eval-rst'}), page
        if page in API:
            assert re.findall(r'^.*\|\s+\|$', content, flags=re.M) == [], 'without a docstring'
    kinds = [kind for kinds in (OF_PROCESS, *OF_NODE.values()) for kind in kinds]
    for page, names in {
        'parameters': [one.description for kind in kinds for one in described(kind)],
        'topics': [*(topic.content for topic in TOPICS), *(service.name for service in SERVICES)],
        'effects': FUNCTIONS,
        'plant_file': [
            f.name for kind in (JointParameters, SensorParameters) for f in fields(kind)
        ],
        'report': KEYS,
    }.items():
        assert [name for name in names if name not in text[page]] == [], page
    assert all(f'## endoscope {name}\n' in text['commands'] for name in ENDOSCOPE)
    assert all(f'## {started.name}\n' in text['nodes'] for started in program.PROGRAMS.values())
    assert all(f'| `{topic.name}` |' in text['topics'] for topic in TOPICS)
    assert all(f'## {name}\n' in text['effects'] for name in CATALOGUE)
    for page, (package, modules) in API.items():
        for module in modules:
            exported = importlib.import_module(f'{package}{module}').__all__
            assert [name for name in exported if f'| `{name}` | ' not in text[page]] == []


def test_every_number_of_an_effects_evidence_is_explained() -> None:
    page = (WORKSPACE / 'doc/explaining.md').read_text()
    assert [key for key in EVIDENCE if f'`{key}`' not in page] == []
    given = {
        key
        for path in (WORKSPACE / 'src/endoscope_explain/endoscope_explain').rglob('*.py')
        for literal in re.findall(r'evidence(?:: dict\S*)? ?= ?\{([^}]*)\}', path.read_text())
        for key in re.findall(r"'(\w+)':", literal)
    }
    assert len(given) > 5
    assert given <= EVIDENCE.keys()


def test_what_other_programs_have_is_said_to_be_here_by_names_that_there_are() -> None:
    page = (WORKSPACE / 'doc/coming_from.md').read_text()
    rows = [line.split(' | ') for line in page.splitlines() if line.startswith('| ')]
    here = ' '.join(row[1] for row in rows)
    topics = re.findall(r'`(\w+/\w+)`', here)
    assert len(topics) > 10
    types = {one.type.replace('/msg/', '/') for one in TOPICS}
    assert set(topics) <= {one.name for one in TOPICS} | types
    rig = yaml.safe_load((WORKSPACE / 'src/endoscope_core/endoscope_core/rig/rig.yaml').read_text())
    keys = re.findall(r'`(joints|timeouts)\.(\w+)`', here)
    assert keys
    assert all(key in rig[room] for room, key in keys)
