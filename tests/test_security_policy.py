"""The SROS2 policy allows each node what it does, and commands to nobody but their one source."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from simulated_graph import SimulatedGraph

from endoscope_nodes.nodes.recorder import RecorderNode

POLICY = Path(__file__).parents[1] / 'ros_ws' / 'security' / 'policy.xml'
NAMESPACE = '/endoscope'
SOLE_PUBLISHERS = {
    'slave/servo_jp': {'console'},
    'motor/servo_jp': {'compensator'},
    'slave/operating_state': {'supervisor'},
    'slave/motion_session': {'supervisor'},
    'slave/state_command': {'operator', 'console_web'},
    'master/clutch': {'console', 'master', 'console_web'},
}


def full(topic):
    return topic if topic.startswith('/') else f'{NAMESPACE}/{topic}'


@pytest.fixture(scope='module')
def allowed():
    """Topics that a node may publish and subscribe, by node."""
    table = {}
    for enclave in ElementTree.parse(POLICY).getroot().iter('enclave'):
        (profile,) = enclave.iter('profile')
        name = profile.get('node')
        assert enclave.get('path') == f'{NAMESPACE}/{name}'
        assert profile.get('ns') == NAMESPACE
        table[name] = {
            verb: {
                full(topic.text)
                for topics in profile.iter('topics')
                if topics.get(verb) == 'ALLOW'
                for topic in topics
            }
            for verb in ('publish', 'subscribe')
        }
    return table


@pytest.mark.parametrize('topic', SOLE_PUBLISHERS)
def test_commands_have_one_source(allowed, topic):
    may = {name for name, topics in allowed.items() if full(topic) in topics['publish']}
    assert may == SOLE_PUBLISHERS[topic]


def test_no_topic_is_allowed_by_a_wildcard(allowed):
    every = {t for topics in allowed.values() for names in topics.values() for t in names}
    assert not [topic for topic in every if '*' in topic]


def test_every_node_may_do_what_it_does(allowed, tmp_path):
    overrides = {'recorder': {'bag': str(tmp_path / 'bag')}}
    with SimulatedGraph(extra=(RecorderNode,), overrides=overrides) as graph:
        for node in graph.runtime.nodes:
            name = node.get_name()
            if name == 'conductor':
                continue
            published = node.get_publisher_names_and_types_by_node(name, NAMESPACE)
            heard = node.get_subscriber_names_and_types_by_node(name, NAMESPACE)
            assert {topic for topic, _ in published} <= allowed[name]['publish'], name
            assert {topic for topic, _ in heard} <= allowed[name]['subscribe'], name
