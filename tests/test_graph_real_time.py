"""The graph in real time, driven by a program that is none of this project's."""

import dataclasses
import math

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header, String

from endoscope_core.rig import Timeouts, load_rig
from endoscope_nodes.graph import CONTROL_NODES, SLAVE_NODES
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.runtime import Runtime

NAMESPACE = '/endoscope/'
PATIENCE_S = 240.0
# Beats and time-outs that a busy machine can keep.
TICK_RATE = 200
RIG = dataclasses.replace(load_rig(), timeouts=Timeouts(command=1.0, stream=10.0, handle=1.0))


class ForeignMaster(Node):
    """A master with ordinary messages, default QoS and its own timer; joints in another order."""

    def __init__(self, context):
        super().__init__('foreign_master', context=context)
        qos = QoSProfile(depth=10)
        self.measured = []
        self.reach = np.zeros(2)
        self.state = self.session = ''
        self.commands = self.create_publisher(JointState, NAMESPACE + 'slave/servo_jp', qos)
        self.clutch = self.create_publisher(Joy, NAMESPACE + 'master/clutch', qos)
        self.orders = self.create_publisher(String, NAMESPACE + 'slave/state_command', qos)
        self.create_subscription(String, NAMESPACE + 'slave/operating_state', self._on_state, qos)
        self.create_subscription(Header, NAMESPACE + 'slave/motion_session', self._on_session, qos)
        self.create_subscription(
            JointState, NAMESPACE + 'motor/measured_js', self._on_measured, qos
        )
        self._begun = None
        self.done = Future()
        self.create_timer(0.005, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_state(self, message):
        self.state = message.data

    def _on_measured(self, message):
        self.measured.append(message)
        self.reach = np.maximum(self.reach, (message.position[0], -message.position[1]))
        if (self.reach > 0.5 * 0.4).all() and not self.done.done():
            self.done.set_result(None)

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


def test_a_foreign_master_moves_the_slave():
    factories = [f for f in (*SLAVE_NODES, *CONTROL_NODES) if f.__name__ != 'MasterNode']
    with Runtime(
        ['--ros-args', '--log-level', 'fatal', '-p', f'tick_rate:={TICK_RATE}'],
        Context(),
        private_domain(),
        {'compensator': {'mode': 'none'}, 'controller': {'active': False}},
        RIG,
    ) as runtime:
        for factory in factories:
            runtime.add(factory)
        console = ForeignMaster(runtime.context)
        runtime.executor.add_node(console)
        try:
            moved = runtime.spin_until(console.done, PATIENCE_S)
            assert moved, f'state {console.state!r}, reach {console.reach}'
            assert list(console.measured[0].name) == ['motor_x', 'motor_y']
            stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in console.measured]
            assert np.diff(stamps).min() > 0
        finally:
            runtime.executor.remove_node(console)
            console.destroy_node()
