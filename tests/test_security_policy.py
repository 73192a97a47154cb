"""The SROS2 policy allows each node what it does, and commands to nobody but their one source."""

import pytest
from security_policy import NAMESPACE, allowed, full
from simulated_graph import SimulatedGraph

from endoscope_nodes.nodes.recorder import RecorderNode

SOLE_PUBLISHERS = {
    'slave/servo_jp': {'master'},
    'slave/servo_jv': {'handle'},
    'slave/servo_cv': {'handle'},
    'motor/servo_jp': {'compensator'},
    'slave/operating_state': {'supervisor'},
    'tip_force/bounds': {'tip_force'},
    'slave/motion_session': {'supervisor'},
    'slave/state_command': {'operator', 'console_web', 'investigate'},
    'master/clutch': {'master', 'handle', 'console_web', 'investigate'},
    'compensator/adopt': {'operator', 'console_web', 'investigate'},
}


ALLOWED = allowed()


@pytest.mark.parametrize('topic', SOLE_PUBLISHERS)
def test_commands_have_one_source(topic):
    may = {name for name, topics in ALLOWED.items() if full(topic) in topics['publish']}
    assert may == SOLE_PUBLISHERS[topic]


def test_no_topic_is_allowed_by_a_wildcard():
    every = {t for topics in ALLOWED.values() for names in topics.values() for t in names}
    assert not [topic for topic in every if '*' in topic]


def test_every_node_may_do_what_it_does(tmp_path):
    overrides = {'recorder': {'bag': str(tmp_path / 'bag')}}
    with SimulatedGraph(extra=(RecorderNode,), overrides=overrides) as graph:
        for node in graph.runtime.nodes:
            name = node.get_name()
            if name == 'simulation_clock':
                continue
            published = node.get_publisher_names_and_types_by_node(name, NAMESPACE)
            heard = node.get_subscriber_names_and_types_by_node(name, NAMESPACE)
            assert {topic for topic, _ in published} <= ALLOWED[name]['publish'], name
            assert {topic for topic, _ in heard} <= ALLOWED[name]['subscribe'], name
