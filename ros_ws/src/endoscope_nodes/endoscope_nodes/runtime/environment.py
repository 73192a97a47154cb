"""What a process takes from its environment before ROS starts, and the nodes it then makes."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.exceptions import InvalidNamespaceException
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from endoscope_core.choices import LOG_LEVEL_VARIABLE, LOG_LEVELS
from endoscope_nodes.runtime.parameters import ParameterError

_NOT_SENT = PublisherEventCallbacks(use_default_callbacks=False)
_NOT_TAKEN = SubscriptionEventCallbacks(use_default_callbacks=False)
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
PEERS = 'ROS_STATIC_PEERS'
PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'
PROFILES_OF_FAST_DDS_3 = 'FASTDDS_DEFAULT_PROFILES_FILE'
"""Its name from ROS 2 Kilted on, which heeds the old one too and warns of it."""
_MIDDLEWARE = 'fastrtps'
_RCLPY_OF_JAZZY = 7
LAST_DOMAIN = 232
"""The ports of higher ones do not exist (DDSI-RTPS 2.5, 9.6.2)."""
LOOPBACK = Path(__file__).with_name('this_machine.xml')
# OFF is nobody but this process, for which Fast DDS listens at every address all the same.
_ON_THIS_MACHINE = ('LOCALHOST', 'OFF')
_WIDER = ('SUBNET', 'SYSTEM_DEFAULT')


class EventlessNode(Node):
    """A node whose publishers and subscriptions wake an executor for messages alone.

    By default rclpy attaches an event to each, to log a QoS that does not match. Served by an
    EventsExecutor such events can dead-lock with Fast DDS (rmw_fastrtps #890), and a publisher that
    is destroyed while an executor waits for its events can crash it (rclpy #1644).
    """

    def create_publisher(
        self, msg_type: type, topic: str, qos_profile: Any, **how: Any
    ) -> Publisher:
        """Offer a topic."""
        return super().create_publisher(
            msg_type, topic, qos_profile, event_callbacks=_NOT_SENT, **how
        )

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable[..., Any], qos_profile: Any, **how: Any
    ) -> Subscription:
        """Subscribe."""
        return super().create_subscription(
            msg_type, topic, callback, qos_profile, event_callbacks=_NOT_TAKEN, **how
        )


def stay_on_this_machine() -> None:
    """Let this machine alone reach the nodes; call it before a context is initialised.

    Whoever can reach the topics can move the slave, and without DDS-Security nothing else stops
    them. `ROS_AUTOMATIC_DISCOVERY_RANGE` in the environment (`SUBNET` for other machines) wins, and
    so do `ROS_STATIC_PEERS` and a profile of one's own for Fast DDS.
    """
    # ROS 2 takes an empty range for SUBNET.
    chosen = os.environ.get(RANGE) or 'LOCALHOST'
    if chosen not in _ON_THIS_MACHINE + _WIDER:
        raise ParameterError(
            f'{RANGE} is {chosen!r}; give LOCALHOST for this machine alone, OFF for this process '
            'alone, SUBNET for other machines too, or SYSTEM_DEFAULT for what Fast DDS does by '
            'itself'
        )
    from rclpy.utilities import get_rmw_implementation_identifier

    os.environ[RANGE] = chosen
    if chosen in _ON_THIS_MACHINE and not os.environ.get(PEERS):
        heeded = _heeded()
        if not any(name in os.environ for name in heeded):
            os.environ[heeded[0]] = str(LOOPBACK)
            # The profile says where to look for others; for LOCALHOST, ROS 2 would add the shared
            # memory to its transport. Another middleware knows no profile, and keeps to the range.
            if chosen == 'LOCALHOST' and _MIDDLEWARE in get_rmw_implementation_identifier():
                os.environ[RANGE] = 'SYSTEM_DEFAULT'


def _heeded() -> tuple[str, ...]:
    """The variables that name a profile for the Fast DDS that is there, its own name first."""
    for distribution in ('ros-rclpy', 'rclpy'):
        with suppress(PackageNotFoundError):
            major = int(version(distribution).split('.')[0])
            return (PROFILES,) if major <= _RCLPY_OF_JAZZY else (PROFILES_OF_FAST_DDS_3, PROFILES)
    return (PROFILES,)


def log_as_asked() -> None:
    """Set the log level of the environment, if any; before ROS starts, whose `--log-level` wins."""
    asked = os.environ.get(LOG_LEVEL_VARIABLE)
    if not asked:
        return
    if asked not in LOG_LEVELS:
        raise ParameterError(
            f'{LOG_LEVEL_VARIABLE} is {asked!r}; give one of {", ".join(LOG_LEVELS)}'
        )
    set_logger_level('', LoggingSeverity[asked.upper()])


@contextmanager
def joined_node(name: str, namespace: str, domain: int | None = None) -> Iterator[Node]:
    """A node of this name in the namespace of a graph, which its owner has to serve."""
    stay_on_this_machine()
    log_as_asked()
    given = os.environ.get('ROS_DOMAIN_ID', '')
    if domain is None and given and not (given.isdecimal() and int(given) <= LAST_DOMAIN):
        raise ParameterError(
            f'ROS_DOMAIN_ID is {given!r}; give a whole number from 0 to {LAST_DOMAIN}'
        )
    context = Context()
    rclpy.init(
        args=[], context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
    )
    with ExitStack() as stack:
        stack.callback(context.try_shutdown)
        try:
            node = stack.enter_context(bare_node(name, f'/{namespace.strip("/")}', context))
        except InvalidNamespaceException as error:
            raise ParameterError(
                f'--namespace {namespace!r} cannot be one: letters, digits, _ and /'
            ) from error
        yield node


@contextmanager
def bare_node(name: str, namespace: str, context: Context) -> Iterator[Node]:
    """A node without a log topic and services of parameters, for as long as it is asked."""
    node = EventlessNode(
        name,
        context=context,
        namespace=namespace,
        enable_rosout=False,
        start_parameter_services=False,
    )
    try:
        yield node
    finally:
        node.destroy_node()
