"""Reads the pose of the instrument's tip, and from it the bending angles."""

from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.time import Time

from endoscope_core.errors import FileError
from endoscope_core.kinematics import (
    RegistrationError,
    StraightRegistration,
    bending_from_orientation,
    tip_pose,
)
from endoscope_core.physics import PlantDescription, SensorModel, recording_faults
from endoscope_devices.em_tracker import (
    AuroraTracker,
    RegistrationWindow,
    TrackerDevice,
    TrackerReading,
    TrackerSettings,
    load_registration,
    save_registration,
)
from endoscope_nodes import names
from endoscope_nodes.runtime.diagnostics import ERROR, OK, STALE, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import EmTrackerParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import LOCK_STEP, SENSOR_OFFERED
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.runtime.ticker import SampleClock


class _SimulatedTracker:
    """Angles as the plant's tracker reads them, at its rate and with its faults."""

    def __init__(self, plant: PlantDescription, seed: int) -> None:
        self._seed = seed
        self._sensors = SensorModel(plant.sensors, seed)
        self._faults = recording_faults(plant)
        self._first_ns: int | None = None
        self._sampling = SampleClock(plant.sensors.tracker_rate)

    def is_due(self, stamp_ns: int) -> bool:
        return self._sampling.due(stamp_ns)

    def read(self, sample: JointSample) -> np.ndarray:
        """Angles (J,) in rad."""
        if self._first_ns is None:
            self._first_ns = sample.stamp_ns
        since = (sample.stamp_ns - self._first_ns) * 1e-9
        return self._faults.spoilt(self._sensors.bending(sample.position), since, self._seed)


class EmTrackerNode(EndoscopeNode):
    """Publishes ``tracker/measured_cp`` and the bending angles ``slave/measured_js``.

    A real tracker knows nothing of the instrument: ``~/register_straight`` takes the mean pose of
    the last second for that of the straight instrument; until then nothing is published.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('em_tracker', context)
        self._settings = self.parameters(EmTrackerParameters, self._on_parameters)
        p = self._settings
        self._last_ns = 0
        self._out_of_reach = 0
        self._tracker: TrackerDevice | None = None
        self._window = RegistrationWindow()
        self._registration: StraightRegistration | None = None
        self._pose = PoseStamped()
        self._pose.header.frame_id = self.rig.instrument.base_frame
        self._poses = self.create_publisher(PoseStamped, names.TRACKER_POSE, SENSOR_OFFERED)
        self._measured = JointPublisher(
            self, names.SLAVE_MEASURED, names.JOINTS, ('position',), SENSOR_OFFERED
        )
        device = self._device_name = p.device or self.rig.devices.tracker
        if device == 'simulated':
            self._simulated = _SimulatedTracker(context.plant, context.seed_of(2))
            JointSubscription(
                self, names.SIMULATED_BENDING, names.JOINTS, self._on_bending, LOCK_STEP
            )
        else:
            self._tracker = self._connect(device, p)
            self.ticker.add(self._on_tick)
        self.serve('~/register_straight', self._register)
        self.diagnostics.add('tracker', self._report, device)

    def _on_parameters(self, parameters: EmTrackerParameters) -> None:
        self._settings = parameters

    @property
    def announcement(self) -> str:
        """Name the device."""
        return f'tracker {self._device_name}'

    def _connect(self, device: str, p: EmTrackerParameters) -> TrackerDevice:
        self.require_real_time(device)
        if not p.port:
            raise ParameterError(f"em_tracker: parameter 'port' is empty: {device} needs it")
        if p.registration_file and Path(p.registration_file).exists():
            try:
                self._registration = load_registration(p.registration_file)
            except FileError as error:
                raise ParameterError(
                    f"em_tracker: parameter 'registration_file': {error}"
                ) from error
        tracker = AuroraTracker(p.port, TrackerSettings(p.tool, p.latency))
        tracker.open()
        return tracker

    def _on_bending(self, sample: JointSample) -> None:
        if not self._simulated.is_due(sample.stamp_ns) or not self._settings.in_volume:
            return
        reading = self._simulated.read(sample)
        if np.hypot(*reading) >= np.pi:
            self._out_of_reach += 1
            return
        self._publish(sample.stamp_ns, *tip_pose(reading, self.rig.instrument.section_length))

    def _on_tick(self, _stamp_ns: int, _periods: int) -> None:
        if self._tracker is None:
            return
        to_stamp_ns = self.ticker.now_ns() - self.ticker.monotonic_ns()
        for reading in self._tracker.take():
            self._window.add(reading)
            if self._registration is not None:
                self._publish_in_base(self._registration, reading, to_stamp_ns)

    def _publish_in_base(
        self, registration: StraightRegistration, reading: TrackerReading, to_stamp_ns: int
    ) -> None:
        position, orientation = registration.in_base(
            reading.position,
            reading.orientation,
            roll=self._settings.sensor_roll,
            length=self.rig.instrument.section_length,
        )
        self._publish(reading.time_ns + to_stamp_ns, position, orientation)

    def _publish(self, stamp_ns: int, position: np.ndarray, orientation: np.ndarray) -> None:
        try:
            bending = bending_from_orientation(orientation)
        except ValueError:
            self._out_of_reach += 1
            return
        self._publish_pose(stamp_ns, position, orientation)
        self._measured.publish(stamp_ns, *bending.tolist())
        self._last_ns = self.ticker.monotonic_ns()

    def _register(self) -> tuple[bool, str]:
        if self._tracker is None:
            return False, 'the simulated tracker knows the straight instrument'
        try:
            registration = self._window.register(self.ticker.monotonic_ns())
            if self._settings.registration_file:
                save_registration(self._settings.registration_file, registration)
        except (RegistrationError, OSError) as error:
            self.get_logger().warning(f'not registered: {error}')
            return False, f'not registered: {error}'
        self._registration = registration
        place = ', '.join(f'{1e3 * v:.1f}' for v in registration.position)
        self.get_logger().info(f'straight instrument registered at {place} mm')
        return True, f'straight instrument registered at {place} mm'

    def _publish_pose(self, stamp_ns: int, position: np.ndarray, orientation: np.ndarray) -> None:
        pose = self._pose.pose
        self._pose.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        pose.position.x, pose.position.y, pose.position.z = position.tolist()
        (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w) = (
            orientation.tolist()
        )
        self._poses.publish(self._pose)

    def _report(self) -> Report:
        values: dict[str, object] = {
            'published': self._measured.count,
            'out of reach': self._out_of_reach,
        }
        if self._tracker is not None:
            trouble, figures = self._tracker.health()
            values |= figures
            if trouble:
                return ERROR, trouble, values
            if self._registration is None:
                return (
                    WARN,
                    f'hold the instrument straight and call {names.REGISTER_STRAIGHT}',
                    values,
                )
        age = self.ticker.monotonic_ns() - self._last_ns
        if self._measured.count == 0 or age > 500_000_000:
            return STALE, 'no poses', values
        return OK, 'tracking', values

    def close(self) -> None:
        """Let go of the tracker."""
        if self._tracker is not None:
            self._tracker.close()
