"""Reads the pose of the instrument's tip, and from it the bending angles."""

from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.time import Time

from endoscope_core.kinematics import bending_from_orientation, tip_pose
from endoscope_core.plant import SensorModel
from endoscope_nodes.diagnostics import OK, STALE, Report
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.names import JOINTS, SIMULATED_BENDING, SLAVE_MEASURED, TRACKER_POSE
from endoscope_nodes.parameters import parameter
from endoscope_nodes.plant_parameter import load_plant_parameter
from endoscope_nodes.qos import LOCK_STEP, SENSOR_OFFERED
from endoscope_nodes.runtime import Runtime, run_nodes
from endoscope_nodes.sampling import SampleClock


@dataclass(frozen=True)
class EmTrackerParameters:
    """Parameters of the EM tracker."""

    device: str = parameter('simulated', 'what is read', choices=('simulated',))
    plant_file: str = parameter(
        '', 'plant.yaml with the noise and rate of the simulated tracker; empty for the nominal one'
    )
    seed: int = parameter(3, 'seed of the simulated sensor noise', low=0)
    section_length: float = parameter(
        0.02, 'length of the bending section', unit='m', low=0.001, high=0.5
    )
    base_frame: str = parameter('endoscope_base', 'frame of the poses')
    in_volume: bool = parameter(
        True,
        'false makes the simulated tracker lose its sensor, which then is silent',
        dynamic=True,
    )


class EmTrackerNode(EndoscopeNode):
    """Publishes ``tracker/measured_cp`` and the bending angles ``slave/measured_js``."""

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('em_tracker', runtime)
        self._settings = self.parameters(EmTrackerParameters, self._on_parameters)
        p = self._settings
        sensors = load_plant_parameter('em_tracker', p.plant_file).sensors
        self._sensors = SensorModel(sensors, p.seed)
        self._sampling = SampleClock(sensors.tracker_rate)
        self._last_ns = 0
        self._out_of_reach = 0
        self._pose = PoseStamped()
        self._pose.header.frame_id = p.base_frame
        self._poses = self.create_publisher(PoseStamped, TRACKER_POSE, SENSOR_OFFERED)
        self._measured = JointPublisher(self, SLAVE_MEASURED, JOINTS, ('position',), SENSOR_OFFERED)
        JointSubscription(self, SIMULATED_BENDING, JOINTS, self._on_bending, LOCK_STEP)
        self.diagnostics.add('tracker', self._report, p.device)

    def _on_parameters(self, parameters: EmTrackerParameters) -> None:
        self._settings = parameters

    def _on_bending(self, sample: JointSample) -> None:
        if not self._sampling.due(sample.stamp_ns) or not self._settings.in_volume:
            return
        reading = self._sensors.bending(sample.position)
        if np.hypot(*reading) >= np.pi:
            self._out_of_reach += 1
            return
        position, orientation = tip_pose(reading, self._settings.section_length)
        self._publish_pose(sample.stamp_ns, position, orientation)
        self._measured.publish(sample.stamp_ns, *bending_from_orientation(orientation).tolist())
        self._last_ns = self.ticker.monotonic_ns()

    def _publish_pose(self, stamp_ns: int, position: np.ndarray, orientation: np.ndarray) -> None:
        pose = self._pose.pose
        self._pose.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        pose.position.x, pose.position.y, pose.position.z = position.tolist()
        (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w) = (
            orientation.tolist()
        )
        self._poses.publish(self._pose)

    def _report(self) -> Report:
        values = {'published': self._measured.count, 'out of reach': self._out_of_reach}
        age = self.ticker.monotonic_ns() - self._last_ns
        if self._measured.count == 0 or age > 500_000_000:
            return STALE, 'no poses', values
        return OK, 'tracking', values


def main() -> int:
    """Run the EM tracker in a process of its own."""
    return run_nodes([EmTrackerNode])
