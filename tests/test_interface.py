"""The tables of topics, services and parameters are what the nodes do, to the QoS."""

from contextlib import ExitStack

import pytest
from rclpy.context import Context

from endoscope_nodes.graph import CONTROL_NODES, SHOWING_NODES, SLAVE_NODES
from endoscope_nodes.runtime.node_parameters import OF_NODE, OF_PROCESS
from endoscope_nodes.runtime.parameters import described
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import profile
from endoscope_nodes.runtime.recorded_topics import message_class
from endoscope_nodes.runtime.runtime import Runtime
from endoscope_nodes.services import SERVICES
from endoscope_nodes.topics import BY_NAME, TOPICS

NAMESPACE = '/endoscope/'
OF_EVERY_NODE = {'/rosout', '/parameter_events', '/clock', '/diagnostics'}
# What a simulated device leaves out.
REAL_ONLY = {('load_cells', 'motor/measured_js')}


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
                    overrides={'master': {'source': 'motion'}, 'watch': {'active': True}},
                )
            ).add(factory)
            for factory in (*SLAVE_NODES, *CONTROL_NODES, *SHOWING_NODES)
        ]
        yield {node.get_name(): node for node in started}


def _topics(endpoints):
    """Topics and what is asked or offered, by name, without those that every node has."""
    return {
        endpoint.topic_name.removeprefix(NAMESPACE): endpoint
        for endpoint in endpoints
        if endpoint.topic_name not in OF_EVERY_NODE
    }


def _past_the_executor(node):
    return node.extra_readers() if hasattr(node, 'extra_readers') else []


def _is(asked, qos):
    wanted = profile(qos)
    return (asked.depth, asked.reliability, asked.durability) == (
        wanted.depth,
        wanted.reliability,
        wanted.durability,
    )


def test_every_topic_has_its_senders_type_and_qos(nodes):
    for name, node in nodes.items():
        said = _topics(node.publishers)
        assert set(said) == {topic.name for topic in TOPICS if name in topic.said_by}, name
        for topic, publisher in said.items():
            assert publisher.msg_type is message_class(BY_NAME[topic].type), topic
            assert _is(publisher.qos_profile, BY_NAME[topic].offered), topic


def test_every_topic_has_its_readers_and_what_they_ask_for(nodes):
    for name, node in nodes.items():
        heard = _topics(node.subscriptions)
        listed = {topic.name for topic in TOPICS if name in topic.heard_by}
        # What is read past the executor is read with a queue of its own.
        past = {topic.removeprefix(NAMESPACE) for topic, _ in _past_the_executor(node)}
        assert set(heard) | past | ({'/diagnostics'} & listed) == {
            topic for topic in listed if (name, topic) not in REAL_ONLY
        }, name
        for topic, subscription in heard.items():
            assert subscription.msg_type is message_class(BY_NAME[topic].type), topic
            assert _is(subscription.qos_profile, BY_NAME[topic].asked), topic


def test_every_service_has_its_node(nodes):
    for name, node in nodes.items():
        served = {
            service.service_name.removeprefix(NAMESPACE)
            for service in node.services
            if 'parameter' not in service.service_name.rpartition('/')[2]
            and not service.service_name.endswith('get_type_description')
        }
        assert served == {s.name for s in SERVICES if s.served_by == name and not s.device}, name


def test_every_node_declares_the_parameters_that_are_listed(nodes):
    of_process = {name for kind in OF_PROCESS for name in kind.__dataclass_fields__}
    of_ros = {'use_sim_time', 'start_type_description_service'}
    for name, node in nodes.items():
        declared = {
            name
            for name in node.get_parameters_by_prefix('')
            if not name.startswith('qos_overrides')
        }
        listed = {parameter.name for kind in OF_NODE[name] for parameter in described(kind)}
        assert declared - of_process - of_ros == listed, name


def test_every_node_is_named_as_it_is(nodes):
    named = {name for topic in TOPICS for name in (*topic.said_by, *topic.heard_by)}
    others = {'every node', 'simulation_clock', 'recorder', 'replay'}
    assert named - others == set(nodes)
