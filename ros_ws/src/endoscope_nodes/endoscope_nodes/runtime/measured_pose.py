"""Where the slave is, as all nodes of a process know it."""

import math
import struct

from rclpy.node import Node
from sensor_msgs.msg import JointState

from endoscope_bags.errors import MalformedMessageError
from endoscope_core.rig import Rig
from endoscope_nodes.names import JOINTS, MOTOR_MEASURED, MOTORS, SLAVE_MEASURED
from endoscope_nodes.runtime.qos import SENSOR_ASKED
from endoscope_nodes.runtime.streams import JointReader, JointSample
from endoscope_nodes.runtime.ticker import Ticker

# At 40 Hz, three missed frames mean that the tracker has lost its sensor.
TRACKER_TIMEOUT_NS = 100_000_000

_STAMP = struct.Struct('<iI')
_STAMP_END = 12


class MeasuredPose:
    """Where shafts and bending section are: what whoever enters a session starts from.

    One serves all nodes of a process: a subscription each would cost more than most nodes do.
    """

    def __init__(self, node: Node, ticker: Ticker, rig: Rig) -> None:
        self._ticker = ticker
        self._gear = rig.joints.gear
        self._timeout_ns = rig.timeouts.stream_ns
        self._shafts_reader = JointReader(MOTORS)
        self._shafts = b''
        self._shafts_stamp = (0, 0)
        self.shafts_ns = 0  # when the newest shaft angles came, monotonic
        self._joints_reader = JointReader(JOINTS)
        self.tracked: JointSample | None = None  # None before the first
        self._tracked_ns = 0
        self.listen(node)

    def listen(self, node: Node) -> None:
        """Subscribe by this node from now on."""
        self.host = node
        node.create_subscription(
            JointState, MOTOR_MEASURED, self._keep_shafts, SENSOR_ASKED, raw=True
        )
        node.create_subscription(
            JointState, SLAVE_MEASURED, self._keep_bending, SENSOR_ASKED, raw=True
        )

    def _keep_shafts(self, data: bytes) -> None:
        # A writer that is killed while it writes may leave a torn message behind, stamped zero.
        if len(data) < _STAMP_END:
            return
        now, stamp = self._ticker.monotonic_ns(), _STAMP.unpack_from(data, 4)
        if stamp > self._shafts_stamp or now - self.shafts_ns > self._timeout_ns:
            self._shafts, self._shafts_stamp, self.shafts_ns = data, stamp, now

    def _keep_bending(self, data: bytes) -> None:
        sample = _read(self._joints_reader, data)
        now = self._ticker.monotonic_ns()
        newer = self.tracked is None or (
            sample is not None and sample.stamp_ns > self.tracked.stamp_ns
        )
        if sample is not None and (newer or now - self._tracked_ns > TRACKER_TIMEOUT_NS):
            self.tracked, self._tracked_ns = sample, now

    def shafts(self) -> tuple[float, ...] | None:
        """Shaft angles in rad, shape (J,); None while none were read lately."""
        if not self._shafts or self._silent(self.shafts_ns, self._timeout_ns):
            return None
        sample = _read(self._shafts_reader, self._shafts)
        return None if sample is None else sample.position

    @property
    def tracks(self) -> bool:
        """Whether the tracker was heard lately."""
        return self.tracked is not None and not self._silent(self._tracked_ns, TRACKER_TIMEOUT_NS)

    def bending(self) -> tuple[float, ...] | None:
        """Bending angles in rad, shape (J,); None while neither tracker nor shafts are known."""
        if self.tracked is not None and self.tracks:
            return self.tracked.position
        # What the shafts would have bent it to without any loss.
        shafts = self.shafts()
        return None if shafts is None else tuple(x / self._gear for x in shafts)

    def _silent(self, heard_ns: int, timeout_ns: int) -> bool:
        return self._ticker.monotonic_ns() - heard_ns > timeout_ns


def _read(reader: JointReader, data: bytes) -> JointSample | None:
    try:
        sample = reader.read(data)
    except MalformedMessageError:
        return None
    return sample if sample.position and all(map(math.isfinite, sample.position)) else None
