"""The graph in real time, driven by a program that is none of this project's."""

import math

import numpy as np
import pytest
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header, String

from endoscope_nodes.graph import CONTROL_NODES, SLAVE_NODES
from endoscope_nodes.runtime import Runtime

# In real time, on a machine that may stall for longer than a device may be silent.
pytestmark = pytest.mark.flaky(reruns=2)

NAMESPACE = '/endoscope/'


class ForeignConsole(Node):
    """A console with ordinary messages, default QoS and its own timer; joints in another order."""

    def __init__(self, context):
        super().__init__('foreign_console', context=context)
        qos = QoSProfile(depth=10)
        self.measured = []
        self.state = self.session = ''
        self.commands = self.create_publisher(JointState, NAMESPACE + 'slave/servo_jp', qos)
        self.clutch = self.create_publisher(Joy, NAMESPACE + 'master/clutch', qos)
        self.orders = self.create_publisher(String, NAMESPACE + 'slave/state_command', qos)
        self.create_subscription(String, NAMESPACE + 'slave/operating_state', self._on_state, qos)
        self.create_subscription(Header, NAMESPACE + 'slave/motion_session', self._on_session, qos)
        self.create_subscription(
            JointState, NAMESPACE + 'motor/measured_js', self.measured.append, qos
        )
        self._begun = None
        self.done = Future()
        self.create_timer(0.005, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_state(self, message):
        self.state = message.data

    def _on_session(self, message):
        self.session = message.frame_id

    def _on_timer(self):
        if not self.session:
            self._begun = None
            self.orders.publish(String(data='enable'))
            return
        now = self.get_clock().now()
        self._begun = self._begun or now
        t = (now - self._begun).nanoseconds * 1e-9
        angle = 0.3 * (1.0 - math.cos(2.0 * t))
        message = JointState(name=['bend_y', 'bend_x'], position=[-angle, angle])
        message.header.stamp = now.to_msg()
        message.header.frame_id = self.session
        self.clutch.publish(Joy(buttons=[1]))
        self.commands.publish(message)
        if t > 3.0 and not self.done.done():
            self.done.set_result(None)


def test_a_foreign_console_moves_the_slave():
    factories = [f for f in (*SLAVE_NODES, *CONTROL_NODES) if f.__name__ != 'ConsoleNode']
    with Runtime(
        ['--ros-args', '--log-level', 'fatal'],
        Context(),
        228,
        {'compensator': {'mode': 'none'}, 'controller': {'active': False}},
    ) as runtime:
        for factory in factories:
            runtime.add(factory)
        console = ForeignConsole(runtime.context)
        runtime.executor.add_node(console)
        try:
            assert runtime.spin_until(console.done, 120.0), f'state {console.state!r}'
            reach = np.array([m.position for m in console.measured])
            assert list(console.measured[0].name) == ['motor_x', 'motor_y']
            assert reach[:, 0].max() > 0.5 * 0.4
            assert reach[:, 1].min() < -0.5 * 0.4
            stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in console.measured]
            assert np.diff(stamps).min() > 0
        finally:
            runtime.executor.remove_node(console)
            console.destroy_node()
