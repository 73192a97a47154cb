"""The README's tables and picture of nodes, topics and parameters are those of the nodes."""

import re
from contextlib import ExitStack
from pathlib import Path

import parameter_table
import pytest
from private_domain import private_domain
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.graph import CONTROL_NODES, SLAVE_NODES
from endoscope_nodes.recorded_topics import type_name
from endoscope_nodes.runtime import Runtime

ROOT = Path(__file__).parents[1]
README = (ROOT / 'README.md').read_text(encoding='utf-8')
NAMESPACE = '/endoscope/'
OF_EVERY_NODE = {'/rosout', '/parameter_events', '/clock'}


def _table(heading: str) -> dict[str, list[str]]:
    """Cells of the table under a heading, by each name in the first column."""
    section = re.split(r'^#+ ', README.split(f'{heading}\n', 1)[1], maxsplit=1, flags=re.M)[0]
    rows = [line.strip('|').split('|') for line in section.splitlines() if line.startswith('| `')]
    return {name: cells[1:] for cells in rows for name in re.findall(r'`([^`]+)`', cells[0])}


NODES = _table('## Nodes and topics')
TOPICS = _table('### Topics')


@pytest.fixture(scope='module')
def nodes():
    """Every node of the simulated graph but the recorder, which takes what there is.

    Each has a runtime of its own, as in a process of its own: those of one process share what they
    hear of the slave's pose.
    """
    domain = private_domain()
    with ExitStack() as runtimes:
        started = [
            runtimes.enter_context(
                Runtime(
                    args=['--ros-args', '--log-level', 'fatal'],
                    context=Context(),
                    domain_id=domain,
                    overrides={'console': {'source': 'motion'}},
                )
            ).add(factory)
            for factory in (*SLAVE_NODES, *CONTROL_NODES)
        ]
        yield {node.get_name(): node for node in started}


def _short(name: str) -> str:
    return name.removeprefix(NAMESPACE)


def _listed(cell: str) -> set[str]:
    """Names in a cell, without what only a real device has."""
    return set(re.findall(r'`([\w/]+/\w+|/\w+)`', cell.split('real:', maxsplit=1)[0]))


def _services(node: EndoscopeNode) -> set[str]:
    return {
        _short(service.service_name)
        for service in node.services
        if 'parameter' not in service.service_name.rpartition('/')[2]
        and not service.service_name.endswith('get_type_description')
    }


def _qos(profile: QoSProfile) -> str:
    words = ['reliable' if profile.reliability == ReliabilityPolicy.RELIABLE else 'best effort']
    if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        words.append('transient local')
    return ', '.join((*words, str(profile.depth)))


def test_every_node_is_listed_with_what_it_hears_says_and_serves(nodes):
    for name, node in nodes.items():
        heard, said, served = NODES[name][:3]
        assert _listed(heard) == {
            _short(s.topic_name) for s in node.subscriptions if s.topic_name not in OF_EVERY_NODE
        }, name
        publishers = {_short(p.topic_name) for p in node.publishers} - OF_EVERY_NODE
        assert _listed(said) | {'/diagnostics'} == publishers, name
        assert _listed(served) == _services(node), name


def test_every_topic_is_listed_with_its_type_and_qos(nodes):
    for name, node in nodes.items():
        for publisher in node.publishers:
            if publisher.topic_name in OF_EVERY_NODE:
                continue
            kind, _, offered = TOPICS[_short(publisher.topic_name)][:3]
            assert kind.strip(' `') == type_name(publisher.msg_type).replace('/msg/', '/'), name
            assert offered.strip() == _qos(publisher.qos_profile), publisher.topic_name
        for subscription in node.subscriptions:
            if subscription.topic_name in OF_EVERY_NODE:
                continue
            _, _, offered, asked = TOPICS[_short(subscription.topic_name)][:4]
            wanted = offered if asked.strip() == 'same' else asked
            assert wanted.strip() == _qos(subscription.qos_profile), (
                name,
                subscription.topic_name,
            )


def test_every_parameter_is_listed():
    section = README.split('### Parameters\n', 1)[1].split('\n## ', 1)[0]
    listed = [line for line in section.splitlines() if line.startswith('| `')]
    assert listed == parameter_table.rows(), 'python tests/parameter_table.py prints the table'


def test_the_parameters_are_those_that_the_nodes_declare(nodes):
    rows = [line.split('`') for line in parameter_table.rows()]
    of_process = {
        *('use_sim_time', 'tick_rate', 'rig_file', 'plant_file', 'seed', 'realtime_priority'),
        *('cores', 'start_type_description_service'),
    }
    for name, node in nodes.items():
        declared = {p for p in node._parameters if not p.startswith('qos_overrides')} - of_process
        assert declared == {row[3] for row in rows if row[1] == name}, name


def test_the_picture_shows_who_speaks_to_whom(nodes):
    drawn = {
        (speaker, listener, topic)
        for speaker, listener, label in re.findall(
            r'(\w+) -> (\w+) \[.*?label="([^"]*)"', (ROOT / 'ros_ws/doc/node_graph.dot').read_text()
        )
        for topic in re.findall(r'\w+/\w+', label.replace('\\n', ' '))
        if speaker in nodes
    }
    # The session goes to every node that moves: the picture has one arrow and says so.
    session = 'slave/motion_session'
    spoken = {
        (speaker, listener, _short(publisher.topic_name))
        for speaker, node in nodes.items()
        for publisher in node.publishers
        for listener, other in nodes.items()
        if listener != speaker
        and publisher.topic_name in {s.topic_name for s in other.subscriptions}
        and publisher.topic_name not in OF_EVERY_NODE | {'/diagnostics', NAMESPACE + session}
        # The clutch is the handle's, for which a console that plays a motion stands in.
        and not publisher.topic_name.startswith(NAMESPACE + 'master/')
    }
    assert drawn == spoken | {('supervisor', 'motor_driver', session)}


def test_the_picture_is_that_of_its_source():
    source = (ROOT / 'ros_ws/doc/node_graph.dot').read_text()
    picture = (ROOT / 'ros_ws/doc/node_graph.svg').read_text()
    arrows = re.findall(r'(\w+) -> (\w+) \[', source)
    assert arrows
    assert sorted(arrows) == sorted(re.findall(r'<title>(\w+)&#45;&gt;(\w+)</title>', picture))
    labels = [
        line for label in re.findall(r'label="([^"]*)"', source) for line in label.split('\\n')
    ]
    shown = re.findall(r'<text[^>]*>([^<]*)</text>', picture.replace('&#45;', '-'))
    assert {line for label in labels for line in label.split('\\n')} <= {
        text.replace('&gt;', '>') for text in shown
    }
