"""Which rate this machine carries: the simulated graph in real time, its commands counted."""

import os
from collections.abc import Callable, Sequence

from rclpy.context import Context
from rclpy.task import Future
from std_msgs.msg import String

from endoscope_nodes.names import OPERATING_STATE, STATE_COMMAND
from endoscope_nodes.nodes.motor_driver import MotorDriverNode
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.qos import EVENT, RESULT
from endoscope_nodes.runtime.runtime import Runtime

Nodes = Sequence[Callable[[NodeContext], EndoscopeNode]]

RATES = (1000, 500, 250)
CARRIED = 0.99
"""Share of the commands that have to reach the motors."""
_FOUND_S, _ENABLED_S, _COUNTED_S = 2.0, 1.5, 4.0


def check(nodes: Nodes) -> int:
    """Try one rate after the other and say which is carried; 1 if none is."""
    for rate in RATES:
        share, trouble = _carried(nodes, rate)
        said = f'{100.0 * share:.1f} % of the commands reach the motors'
        print(f'{rate:>4} Hz: {said}{trouble and f": {trouble}"}', flush=True)
        if share >= CARRIED and not trouble:
            how = '' if rate == RATES[0] else f': graph --real-time --ros-args -p tick_rate:={rate}'
            print(f'this machine carries {rate} Hz in real time, as busy as it is now{how}')
            return 0
    print(
        f'this machine does not even carry {RATES[-1]} Hz in real time, as busy as it is now: end '
        'other programs, or give realtime_priority; a simulated slave needs no rate'
    )
    return 1


def _carried(nodes: Nodes, rate: int) -> tuple[float, str]:
    """Share of the commands of a played motion that reach the motors, and what ended it."""
    arguments = ['--ros-args', '--log-level', 'fatal', '-r', f'__ns:=/check_{os.getpid()}']
    arguments += ['-p', 'use_sim_time:=false', '-p', f'tick_rate:={rate}']
    played = {'console': {'source': 'motion', 'motion': 'periodic'}}
    with Runtime(arguments, Context(), overrides=played) as runtime:
        for factory in nodes:
            runtime.add(factory)
        asker = runtime.add(lambda runtime: EndoscopeNode('rate_check', runtime))
        states = ['']

        def note(message: String) -> None:
            states.append(message.data)

        asker.create_subscription(String, OPERATING_STATE, note, RESULT)
        orders = asker.create_publisher(String, STATE_COMMAND, EVENT)
        runtime.prepare(whole_process=True)
        runtime.spin_until(Future(), _FOUND_S)
        orders.publish(String(data='enable'))
        runtime.spin_until(Future(), _ENABLED_S)
        [driver] = [node for node in runtime.nodes if isinstance(node, MotorDriverNode)]
        gate = driver.motion.gate
        obeyed = gate.accepted
        runtime.spin_until(Future(), _COUNTED_S)
        share = (gate.accepted - obeyed) / (_COUNTED_S * rate)
        return min(1.0, share), '' if states[-1] == 'ENABLED' else states[-1] or 'nobody answers'
