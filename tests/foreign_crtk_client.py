"""A client as those of CRTK robots are, which shares no code with the project.

It enables the slave, bends it by velocities for the seconds that are named first, stops it by the
service, and prints as JSON what it was answered and how far the slave was desired to bend.
"""

import json
import sys

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger

PERIOD_S = 0.02
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Arm(Node):
    """The slave, by the names of the Collaborative Robotics Toolkit."""

    def __init__(self):
        super().__init__('crtk_client', namespace='endoscope')
        self.operating_state, self.session, self.desired = '', '', []
        listen = self.create_subscription
        listen(String, 'slave/operating_state', self._on_state, LATCHED)
        listen(Header, 'slave/motion_session', self._on_session, 10)
        listen(JointState, 'slave/servo_jp', self._on_desired, 1)
        self._orders = self.create_publisher(String, 'slave/state_command', 10)
        self._clutch = self.create_publisher(Joy, 'master/clutch', 10)
        self._rates = self.create_publisher(JointState, 'slave/servo_jv', 1)
        self._stop = self.create_client(Trigger, 'slave/stop')

    def _on_state(self, message):
        self.operating_state = message.data

    def _on_session(self, message):
        self.session = message.frame_id

    def _on_desired(self, message):
        self.desired.append(list(message.position))

    def until(self, condition):
        while not condition():
            rclpy.spin_once(self, timeout_sec=0.1)

    def enable(self):
        self.until(lambda: self._orders.get_subscription_count() and self._stop.service_is_ready())
        while not self.session:
            self._orders.publish(String(data='enable'))
            self.wait(0.2)

    def wait(self, seconds):
        end = self.get_clock().now().nanoseconds + round(seconds * 1e9)
        self.until(lambda: self.get_clock().now().nanoseconds >= end)

    def servo_jv(self, velocity):
        message = JointState(name=['bend_x', 'bend_y'], velocity=velocity)
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id = self.session
        self._clutch.publish(Joy(buttons=[1]))
        self._rates.publish(message)

    def stop(self):
        answer = self._stop.call_async(Trigger.Request())
        self.until(answer.done)
        return answer.result().message


rclpy.init()
arm = Arm()
arm.enable()
begin = arm.get_clock().now().nanoseconds
while arm.get_clock().now().nanoseconds - begin < float(sys.argv[1]) * 1e9:
    arm.servo_jv([0.4, -0.2])
    arm.wait(PERIOD_S)
told = {'enabled': arm.operating_state, 'stopped': arm.stop()}
told['way'] = [last - first for first, last in zip(arm.desired[0], arm.desired[-1], strict=True)]
print(json.dumps(told))
arm.destroy_node()
rclpy.shutdown()
