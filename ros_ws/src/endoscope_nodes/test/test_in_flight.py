"""In lock-step all that a tick makes the nodes say is heard before the next tick."""

import pytest
from rclpy.context import Context
from std_msgs.msg import UInt64

from endoscope_nodes.names import MOTOR_MEASURED, MOTORS
from endoscope_nodes.nodes.simulation_clock import SimulationClockNode
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.qos import LOCK_STEP, SENSOR_OFFERED
from endoscope_nodes.runtime.runtime import Runtime
from endoscope_nodes.runtime.streams import JointPublisher

HOPS = 5
TICKS = 100


def link(number):
    """A node that passes on what the one before it says; the first one says the time."""

    class Link(EndoscopeNode):
        def __init__(self, runtime):
            super().__init__(f'link_{number}', runtime)
            self.late = []
            self.heard = 0
            self._out = self.create_publisher(UInt64, f'word_{number}', LOCK_STEP)
            if number:
                self.create_subscription(UInt64, f'word_{number - 1}', self._pass_on, LOCK_STEP)
            else:
                self._motors = JointPublisher(
                    self, MOTOR_MEASURED, MOTORS, ('position',), SENSOR_OFFERED
                )
                self.ticker.add(self._begin)

        def _begin(self, stamp, _):
            # The clock hears this one at once, the last link hears of it late.
            self._motors.publish(stamp, *(0.0,) * len(MOTORS))
            self._out.publish(UInt64(data=stamp))

        def _pass_on(self, message):
            self.heard += 1
            self.late.append(self.ticker.now_ns() - message.data)
            self._out.publish(message)

    return Link


@pytest.fixture
def links():
    arguments = ['--ros-args', '-p', 'use_sim_time:=true', '-p', 'tick_rate:=500']
    waits = {'simulation_clock': {'wait_for': [MOTOR_MEASURED]}}
    with Runtime(arguments, Context(), 229, waits) as runtime:
        links = [runtime.add(link(number)) for number in range(HOPS)]
        clock = runtime.add(SimulationClockNode)
        assert runtime.spin_until(clock.advance(TICKS / 500), 60.0)
        yield links


def test_no_tick_begins_before_the_last_word_of_the_one_before_is_heard(links):
    for node in links[1:]:
        assert node.heard >= TICKS - 10
        assert set(node.late) == {0}, node.get_name()
