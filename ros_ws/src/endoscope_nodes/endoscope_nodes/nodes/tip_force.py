"""Publishes the force across the tip that wires, motors and tracker show by the plant in force."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.time import Time
from threadpoolctl import threadpool_limits

from endoscope_core.calibration.calibration_run import OrderState
from endoscope_core.errors import FileError
from endoscope_core.kinematics import Vertebrae
from endoscope_core.physics import PlantDescription
from endoscope_core.tip_force import State, TipForce, TipForceEstimator
from endoscope_core.tip_force.free_motion import BLOCK_S
from endoscope_nodes import names
from endoscope_nodes.client.graph_listener import feedback_of
from endoscope_nodes.nodes.rig_follower import STREAMS, RigFollower
from endoscope_nodes.runtime.diagnostics import OK, WARN, Report
from endoscope_nodes.runtime.node_context import NodeContext, adopted_plant
from endoscope_nodes.runtime.node_parameters import TipForceParameters
from endoscope_nodes.runtime.qos import RESULT, SENSOR_OFFERED
from endoscope_nodes.runtime.streams import JointPublisher

_SECOND = 1_000_000_000
_CALIBRATE = 'calibrate'


class TipForceNode(RigFollower[list[TipForce]]):
    """Works out what the tip touches, 40 times a second, in a thread of its own.

    The plant is the one in force: the adopted one, or else the one described. Nothing touches the
    tip while it calibrates: from that motion come the bounds, and before it there is no force.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('tip_force', context)
        self._active = self.parameters(TipForceParameters).active
        self.diagnostics.add('force', self._report)
        if not self._active:
            return
        instrument = self.rig.instrument
        self._frame = Vertebrae(instrument.section_length, instrument.base_frame).tip_frame
        self._plant = context.plant
        self._free = False
        self._last: TipForce | None = None
        self._published = 0
        # Of small matrices: threads for each would stand in the way of the other nodes.
        threadpool_limits(1, 'blas')
        self.estimator = _compiled(self._plant, instrument.section_length)
        self._forces = self.create_publisher(WrenchStamped, names.TIP_FORCE, SENSOR_OFFERED)
        self._bounds = JointPublisher(
            self, names.TIP_FORCE_BOUNDS, names.BOUNDS, ('effort',), SENSOR_OFFERED
        )
        self.create_subscription(
            DiagnosticArray, names.CALIBRATION_FEEDBACK, self._on_feedback, RESULT
        )
        self._follow(STREAMS, BLOCK_S)

    def _on_feedback(self, message: DiagnosticArray) -> None:
        order = feedback_of(message)
        self._free = order.order == _CALIBRATE and order.state == OrderState.EXECUTING

    def _take(self, found: list[TipForce]) -> None:
        for force in found:
            self._publish(force)

    def _next(self) -> Callable[[], list[TipForce]]:
        if self._wanted:
            self._wanted = False
            self._begin()
        return partial(self._work, self._free)

    def _begin(self) -> None:
        """Start anew with the plant in force."""
        try:
            plant = adopted_plant(self._adopted.plant) or self._plant
        except FileError as error:
            self.get_logger().error(f'continues with the plant before: {error}')
            return
        self.estimator = TipForceEstimator(plant, self.rig.instrument.section_length)
        self._forget()
        self._last = None

    def _work(self, free: bool) -> list[TipForce]:
        self.estimator.free = free
        newest = self._pass_on(self.estimator)
        return self.estimator.update(max(newest.values())) if newest else []

    def _publish(self, force: TipForce) -> None:
        changed = self._last is None or self._last.seen != force.seen
        self._last = force
        message = WrenchStamped()
        stamp_ns = self._origin_ns + round(force.time * _SECOND)
        message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        message.header.frame_id = self._frame
        message.wrench.force.x, message.wrench.force.y = force.force.tolist()
        message.wrench.force.z = math.nan
        self._forces.publish(message)
        bounds = (*force.force, *force.low, *force.high, force.seen)
        self._bounds.publish(stamp_ns, *map(float, bounds))
        self._published += 1
        if changed:
            self.diagnostics.publish()

    def _report(self) -> Report:
        if not self._active:
            return OK, 'off', {}
        estimator, force = self.estimator, self._last
        values: dict[str, object] = {
            'plant': self._adopted.hash or 'as described',
            'published': self._published,
            'begun anew': estimator.restarts,
            'because': estimator.restarted_because,
        }
        if estimator.state is not State.KNOWN or force is None:
            return OK, f'no force: {estimator.state}', values
        values |= {
            'force [N]': force.size,
            'at least [N]': force.at_least,
            'at most [N]': force.at_most,
            'visible [N]': force.visible,
            'along the axis': 'cannot be seen',
        }
        if force.seen:
            bounds = f'{force.at_least:.2g} to {force.at_most:.2g} N'
            return WARN, f'the tip touches something: {force.size:.2g} N ({bounds})', values
        return OK, f'nothing touches the tip with {force.visible:.2g} N or more', values


def _compiled(plant: PlantDescription, section_length: float) -> TipForceEstimator:
    """An estimator, once all that it calls is compiled."""
    estimator = TipForceEstimator(plant, section_length)
    time = np.linspace(0.0, 0.5, 500)
    for samples in (estimator.motor, estimator.wires, estimator.tracker):
        samples.append(time, np.zeros((len(time), samples.columns)))
    estimator.update(0.5)
    return TipForceEstimator(plant, section_length)
