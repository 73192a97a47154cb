"""A program joins a running graph as a node of its own, for as long as it asks it for something."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from endoscope_core.errors import EndoscopeError
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.runtime.environment import log_as_asked, stay_on_this_machine

LAST_DOMAIN = 232
"""The ports of higher ones do not exist (DDSI-RTPS 2.5, 9.6.2)."""


@contextmanager
def joined_graph(name: str, namespace: str, domain: int | None = None) -> Iterator[GraphClient]:
    """Join the graph of a namespace as a node of this name, for as long as the block lasts."""
    with joined_node(name, namespace, domain) as node:
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)

        def serve(seconds: float) -> None:
            end = time.monotonic() + seconds
            while (left := end - time.monotonic()) > 0.0:
                executor.spin_once(timeout_sec=left)

        try:
            with GraphClient(node, serve) as client:
                yield client
        finally:
            executor.shutdown()


@contextmanager
def joined_node(name: str, namespace: str, domain: int | None = None) -> Iterator[Node]:
    """A node of this name in the namespace of a graph, which its owner has to serve."""
    stay_on_this_machine()
    log_as_asked()
    given = os.environ.get('ROS_DOMAIN_ID', '')
    if domain is None and given and not (given.isdecimal() and int(given) <= LAST_DOMAIN):
        raise EndoscopeError(
            f'ROS_DOMAIN_ID is {given!r}; give a whole number from 0 to {LAST_DOMAIN}'
        )
    context = Context()
    rclpy.init(
        args=[], context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
    )
    try:
        with _node(name, namespace, context) as node:
            yield node
    finally:
        context.try_shutdown()


@contextmanager
def _node(name: str, namespace: str, context: Context) -> Iterator[Node]:
    try:
        node = Node(
            name,
            context=context,
            namespace=f'/{namespace.strip("/")}',
            enable_rosout=False,
            start_parameter_services=False,
        )
    except InvalidNamespaceException as error:
        raise EndoscopeError(
            f'--namespace {namespace!r} cannot be one: letters, digits, _ and /'
        ) from error
    try:
        yield node
    finally:
        node.destroy_node()
