"""The pictures of the documentation are those of their sources, and of the code."""

import re
from pathlib import Path

import pytest
from doc_pages import WORKSPACE

from endoscope_core.safety.operating_state import OperatingState
from endoscope_nodes import names
from endoscope_nodes.topics import TOPICS

DOC = WORKSPACE / 'doc'
NODES = {
    *('master', 'compensator', 'controller', 'calibration', 'supervisor'),
    *('motor_driver', 'load_cells', 'em_tracker', 'instrument_model'),
}


@pytest.mark.parametrize('source', sorted(DOC.glob('*.dot')), ids=lambda path: path.stem)
def test_the_picture_is_that_of_its_source(source: Path) -> None:
    text = source.read_text()
    picture = source.with_suffix('.svg').read_text()
    arrows = re.findall(r'(\w+) -> (\w+) \[', text)
    assert arrows
    assert sorted(arrows) == sorted(re.findall(r'<title>(\w+)&#45;&gt;(\w+)</title>', picture))
    shown = {
        text.replace('&gt;', '>')
        for text in re.findall(r'<text[^>]*>([^<]*)</text>', picture.replace('&#45;', '-'))
    }
    labels = [line for label in re.findall(r'label="([^"]*)"', text) for line in label.split('\\n')]
    assert set(labels) <= shown


def test_the_graph_shows_who_speaks_to_whom() -> None:
    drawn = {
        (speaker, listener, topic)
        for speaker, listener, label in re.findall(
            r'(\w+) -> (\w+) \[.*?label="([^"]*)"', (DOC / 'node_graph.dot').read_text()
        )
        for topic in re.findall(r'\w+/\w+', label.replace('\\n', ' '))
        if speaker in NODES and listener in NODES
    }
    # The session goes to every node that moves: the picture has one arrow and says so. A master
    # that plays a motion holds the clutch in place of the handle, which the picture shows.
    session = names.MOTION_SESSION
    spoken = {
        (speaker, listener, topic.name)
        for topic in TOPICS
        if topic.name not in (session, names.DIAGNOSTICS, names.MASTER_CLUTCH)
        for speaker in topic.said_by
        for listener in topic.heard_by
        if speaker != listener and {speaker, listener} <= NODES
    }
    # Only real load cells are told when shafts turn, for their tare.
    spoken.remove(('motor_driver', 'load_cells', names.MOTOR_MEASURED))
    assert drawn == spoken | {('supervisor', 'motor_driver', session)}


def test_the_states_are_those_of_the_supervisor() -> None:
    drawn = re.findall(r'^  (\w+) -> (\w+)', (DOC / 'operating_states.dot').read_text(), flags=re.M)
    assert {state for arrow in drawn for state in arrow} == {s.value for s in OperatingState}
