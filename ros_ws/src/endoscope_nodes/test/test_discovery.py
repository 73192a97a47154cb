"""Nodes are reached from this machine alone unless the operator says otherwise."""

import os
import subprocess
import sys
import time

import pytest
import rclpy
from rclpy.context import Context

from endoscope_nodes.runtime.environment import stay_on_this_machine
from endoscope_nodes.runtime.parameters import ParameterError

DOMAIN = 227
# DDSI-RTPS 9.6.1.1: ports of a domain begin at 7400 + 250 * domain.
SHOW = f"""
import os
from pathlib import Path
from rclpy.context import Context
from rclpy.node import Node
from endoscope_nodes.runtime.runtime import Runtime
with Runtime(['--ros-args'], Context(), {DOMAIN}) as runtime:
    node = Node('listening', context=runtime.context)
    print(os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'])
    print('/dev/shm/fast' in Path('/proc/self/maps').read_text())
    own = {{os.readlink(f) for f in Path('/proc/self/fd').iterdir() if f.is_symlink()}}
    for line in Path('/proc/self/net/udp').read_text().splitlines()[1:]:
        fields = line.split()
        address, port = fields[1].split(':')
        if f'socket:[{{fields[9]}}]' in own and 0 <= int(port, 16) - 7400 - 250 * {DOMAIN} < 250:
            print(address)
    node.destroy_node()
"""
PROFILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
NAMES = ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS', *PROFILES)
LOOPBACK = '0100007F'
ANY_ADDRESS = '00000000'


def shown(**given):
    environment = {k: v for k, v in os.environ.items() if k not in NAMES} | given
    done = subprocess.run(
        [sys.executable, '-c', SHOW], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stderr == ''
    found, shared, *addresses = done.stdout.split()
    return found, shared == 'True', set(addresses)


@pytest.mark.parametrize(
    'given',
    [
        {},
        *(
            pytest.param({NAMES[0]: range_}, marks=pytest.mark.nightly)
            for range_ in ('', 'LOCALHOST')
        ),
    ],
)
def test_by_default_no_other_machine_can_reach_the_ports(given):
    # A process that stands still would take others with it through memory that they share.
    assert shown(**given) == ('SYSTEM_DEFAULT', False, {LOOPBACK})


def test_a_middleware_that_knows_no_profile_keeps_to_this_machine_by_its_range(monkeypatch):
    for name in NAMES:
        # Set first, so that what is set afterwards goes with the test.
        monkeypatch.setenv(name, '')
        monkeypatch.delenv(name)
    monkeypatch.setattr(
        'rclpy.utilities.get_rmw_implementation_identifier', lambda: 'rmw_cyclonedds_cpp'
    )
    stay_on_this_machine()
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'


def test_nobody_is_heard_at_no_address_but_the_loopback():
    found, _, addresses = shown(ROS_AUTOMATIC_DISCOVERY_RANGE='OFF')
    assert (found, addresses) == ('OFF', {LOOPBACK})


@pytest.mark.parametrize('unknown', ['localhost', 'Localhost', 'off', 'LOCAL', 'SUBNET '])
def test_a_range_that_ros_would_take_for_the_subnet_is_refused(monkeypatch, unknown):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', unknown)
    with pytest.raises(ParameterError, match='give LOCALHOST') as caught:
        stay_on_this_machine()
    assert repr(unknown) in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('given', 'used'),
    [
        ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}, 'SUBNET'),
        pytest.param(
            {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT'},
            'SYSTEM_DEFAULT',
            marks=pytest.mark.nightly,
        ),
        ({'ROS_STATIC_PEERS': '192.0.2.77'}, 'LOCALHOST'),
    ],
)
def test_the_operator_may_let_others_in(given, used):
    found, _, addresses = shown(**given)
    assert found == used
    assert ANY_ADDRESS in addresses


BE_THERE = """
import sys, time
from rclpy.context import Context
import rclpy
from std_msgs.msg import String
from endoscope_nodes.runtime.environment import stay_on_this_machine
stay_on_this_machine()
context = Context()
rclpy.init(args=[], context=context, domain_id=DOMAIN)
node = rclpy.create_node('there', context=context)
node.create_publisher(String, sys.argv[1], 1)
print('there', flush=True)
time.sleep(600)
""".replace('DOMAIN', str(DOMAIN))
DEFAULT_LEASE = """\
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>
  <participant profile_name="plain" is_default_profile="true"><rtps/></participant>
</profiles></dds>
"""


def process_that_is_there(topic, **given):
    process = subprocess.Popen(
        [sys.executable, '-c', BE_THERE, topic],
        env=os.environ | given,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == 'there\n'
    return process


def test_a_killed_process_is_forgotten_long_before_the_lease_of_fast_dds_ends(tmp_path):
    profile = tmp_path / 'plain.xml'
    profile.write_text(DEFAULT_LEASE)
    context = Context()
    rclpy.init(args=[], context=context, domain_id=DOMAIN)
    node = rclpy.create_node('watcher', context=context)
    processes = [
        process_that_is_there('slow', **dict.fromkeys(PROFILES, str(profile))),
        process_that_is_there('quick'),
        process_that_is_there('alive'),
    ]
    try:
        wait_until(lambda: all(node.count_publishers(t) for t in ('slow', 'quick', 'alive')))
        for process in processes[:2]:
            process.kill()
        wait_until(lambda: not node.count_publishers('quick'))
        assert node.count_publishers('slow') == 1
        assert node.count_publishers('alive') == 1
    finally:
        for process in processes:
            process.kill()
            process.communicate()
        node.destroy_node()
        context.shutdown()


def wait_until(condition):
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)
