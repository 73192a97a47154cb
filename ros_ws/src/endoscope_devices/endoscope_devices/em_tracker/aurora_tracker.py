"""Frames of one sensor of an Aurora, read by a thread of their own, and when each was measured."""

import math
import time
from dataclasses import dataclass
from typing import Protocol

from scipy.spatial.transform import Rotation

from endoscope_devices.device import DeviceError, ReadingThread
from endoscope_devices.em_tracker.aurora_port import AuroraPort, TrackerReplyError
from endoscope_devices.em_tracker.tx_reply import (
    MalformedReplyError,
    PortStatus,
    ToolReading,
    parse_tx,
)

TURN_RATE = 25.0
"""Fastest turn of the tip in rad/s.

The fastest servo that the motor driver knows runs at 8.06 rad/s (XM430-W210, 77 rpm without load),
a joint at twice that with the nominal gear of 0.5, and two joints together at sqrt(2) times that.
"""

SPEED = 1.5
"""Fastest motion of the tip in m/s.

A bending section of 20 mm that turns at `TURN_RATE` moves its tip by 0.5 m/s; a hand that moves the
whole instrument stays below 1 m/s.
"""

TURN_NOISE = 0.037
POSITION_NOISE = 0.008
"""What noise may add in rad and m: six times the deviation of a difference of two readings.

That of a reading is 0.25 deg in the nominal rig, and taken for 0.9 mm.
"""

CONFIRMATIONS = 3
"""So many poses in a row that agree with each other are where the sensor now is."""

_DRIFT = 1e-4
_REOPEN_S = 0.3
_KEPT = 200
_PAUSE_S = 0.002
_GIVE_UP = 5
# So many late frames in a row, a second of them, or replies with an impossible frame number, mean
# that the estimate of the frame times is wrong.
_FOR_GOOD = 40
# So far before its time a frame may seem to come: the replies before it may have waited as long.
_AHEAD_NS = 100_000_000


class PoseCheck:
    """Judges each pose, at `rate` frames a second, by the last one that was believed."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._believed: ToolReading | None = None
        self._candidate: ToolReading | None = None
        self._agreeing = 0

    def believable(self, tool: ToolReading) -> bool:
        """Whether servos and hand can have moved a tip there since the last believed frame."""
        if self._believed is not None and not self._near(self._believed, tool):
            agrees = self._candidate is not None and self._near(self._candidate, tool)
            self._agreeing = self._agreeing + 1 if agrees else 1
            self._candidate = tool
            if self._agreeing < CONFIRMATIONS:
                return False
        self._believed = tool
        self._candidate = None
        return True

    def _near(self, before: ToolReading, now: ToolReading) -> bool:
        seconds = (now.frame - before.frame) / self._rate
        first, second = Rotation.from_quat([before.orientation, now.orientation])
        turned = float((first.inv() * second).magnitude())
        moved = math.dist(before.position, now.position)
        return (
            turned <= TURN_NOISE + TURN_RATE * seconds and moved <= POSITION_NOISE + SPEED * seconds
        )


class FrameClock:
    """Lays frame numbers on the host's clock, at `rate` frames a second.

    Frames are equally spaced; a reply comes after its frame by a time that varies. The earliest
    reply, relative to its number, shows where the frames lie (NDI advises to use the frame number,
    not the host's clock, for the time of collection). The line follows clocks that drift apart by
    up to ``1e-4``.
    """

    def __init__(self, rate: float) -> None:
        self._period_ns = 1e9 / rate
        self._offset_ns: float | None = None
        self._frame = 0

    def stamp(self, frame: int, asked_ns: int) -> int:
        """Time in ns of a frame newer than the last, never after its reply was asked for."""
        seen = asked_ns - frame * self._period_ns
        self._offset_ns = seen if self._offset_ns is None else min(seen, self._latest_ns(frame))
        self._frame = frame
        return round(self._offset_ns + frame * self._period_ns)

    def ahead_ns(self, frame: int, asked_ns: int) -> int:
        """How much earlier than it can have been measured a frame was seen; 0 if it was not."""
        if self._offset_ns is None:
            return 0
        return max(0, round(self._latest_ns(frame) + frame * self._period_ns - asked_ns))

    def _latest_ns(self, frame: int) -> float:
        """Latest time of frame 0, after what the clocks may have drifted until a frame."""
        passed = (frame - self._frame) * self._period_ns
        return (self._offset_ns or 0.0) + _DRIFT * passed


@dataclass(frozen=True)
class TrackerSettings:
    """How the tracker is read: times in s, rate in Hz."""

    tool: int = 1  # which of the enabled sensors, from 1 on in the order of their ports
    # Time in s from measuring a frame to having it ready, by which stamps are put back.
    latency: float = 0.0
    frame_rate: float = 40.0  # Hz
    oldest: float = 0.1  # s after which a frame that comes is of no more use


@dataclass(frozen=True)
class TrackerReading:
    """The sensor in a frame that was not seen before: in m, and by the field generator's axes."""

    time_ns: int  # when it was measured, of ``time.monotonic_ns``
    frame: int  # number
    position: tuple[float, ...]  # m, (3,)
    orientation: tuple[float, ...]  # unit quaternion x, y, z, w


class TrackerDevice(Protocol):
    """Interface of a tracker of any maker, for the node `em_tracker`.

    A real one reads in a thread of its own: no call waits for the tracker.
    """

    def open(self) -> None:
        """Start to read; a tracker that is not there yet is waited for, and is a trouble."""

    def take(self) -> list[TrackerReading]:
        """New poses of the sensor since the last call, oldest first, none of them twice."""

    def health(self) -> tuple[str, dict[str, object]]:
        """What is wrong (empty if nothing), and figures for diagnostics."""

    def close(self) -> None:
        """Release the tracker."""


class AuroraTracker(ReadingThread[TrackerReading]):
    """Polls the newest frame, and keeps each that is new and shows the sensor.

    A whole reply that was buffered on the way has a valid CRC; its frame number identifies it as
    old.  Numbers increase, and no faster than the frame clock.  A pose that the tip cannot have
    reached is dropped as well (`PoseCheck`).  A tracker that disconnects, or restarts its frame
    count, is reopened for as long as the device is open.
    """

    def __init__(self, port: str, settings: TrackerSettings) -> None:
        super().__init__('aurora tracker', _KEPT)
        self._path = port
        self._settings = settings
        self._port = AuroraPort(port)
        self._start_clock()
        self._handle = -1
        self._frame: int | None = None
        self._misnumbered = 0
        self._poses = PoseCheck(settings.frame_rate)
        self._trouble = 'not connected yet'

    def health(self) -> tuple[str, dict[str, object]]:
        """What is wrong (empty if nothing), and figures for diagnostics."""
        trouble = self._trouble
        if not trouble and self._silent():
            trouble = 'no frame'
        figures = self._age_figure()
        for name in (
            'readings',
            'lost frames',
            'missing',
            'sensor broken',
            'late',
            'old frames',
            'frames ahead of time',
            'jumps',
            'refused replies',
            'silences',
            'connections',
        ):
            figures[name] = self._counts[name]
        return trouble, figures

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._port.open()
                self._bring_up()
                self._counts['connections'] += 1
                self._read_on()
                self._port.ask('TSTOP:')
            except DeviceError as error:
                self._trouble = str(error)
            finally:
                self._port.close()
            self._stop.wait(_REOPEN_S)

    def _bring_up(self) -> None:
        """Initialise and enable every sensor that is plugged in, and start tracking."""
        for handle in _handles(self._port.ask('PHSR:02')):
            self._port.ask(f'PINIT:{handle:02X}')
        for handle in _handles(self._port.ask('PHSR:03')):
            self._port.ask(f'PENA:{handle:02X}D')
        enabled = _handles(self._port.ask('PHSR:04'))
        if len(enabled) < self._settings.tool:
            raise DeviceError(
                f'tracker at {self._path} has {len(enabled)} sensors, number '
                f'{self._settings.tool} is asked for: plug it in'
            )
        self._handle = enabled[self._settings.tool - 1]
        self._frame = None
        self._misnumbered = 0
        self._poses = PoseCheck(self._settings.frame_rate)
        self._start_clock()
        self._port.ask('TSTART:')

    def _start_clock(self) -> None:
        self._clock = FrameClock(self._settings.frame_rate)
        self._late_in_a_row = 0

    def _read_on(self) -> None:
        failures = 0
        while not self._stop.wait(_PAUSE_S):
            try:
                if failures:
                    self._port.fence()
                asked = time.monotonic_ns()
                tools = parse_tx(self._port.ask('TX:0001'))
            except TrackerReplyError as error:
                failures += 1
                self._counts['silences' if error.silent else 'refused replies'] += 1
                self._trouble = str(error)
                if failures >= _GIVE_UP:
                    raise
                continue
            except MalformedReplyError as error:
                failures += 1
                self._counts['refused replies'] += 1
                self._trouble = f'tracker, TX: {error}'
                continue
            failures = 0
            self._take(asked, tools)

    def _take(self, asked_ns: int, tools: list[ToolReading]) -> None:
        tool = next((t for t in tools if t.handle == self._handle), None)
        if tool is None:
            self._trouble = f'sensor {self._settings.tool} was unplugged'
            return
        if tool.frame == self._frame:
            self._misnumbered = 0
            return
        if not self._follows(tool.frame, asked_ns):
            return
        if self._frame is not None:
            self._counts['lost frames'] += tool.frame - self._frame - 1
        measured = self._clock.stamp(tool.frame, asked_ns)
        self._frame = tool.frame
        if tool.status & (PortStatus.SENSOR_BROKEN | PortStatus.PROCESSING_EXCEPTION):
            self._counts['sensor broken'] += 1
            self._trouble = 'a coil of the sensor is broken'
        elif not tool.position or tool.status & PortStatus.OUT_OF_VOLUME:
            self._counts['missing'] += 1
            self._trouble = 'the sensor is out of the measurement volume'
        elif asked_ns - measured > self._settings.oldest * 1e9:
            self._counts['late'] += 1
            self._late_in_a_row += 1
            if self._late_in_a_row >= _FOR_GOOD:
                self._start_clock()
            self._trouble = f'frames come {(asked_ns - measured) * 1e-6:.0f} ms late'
        elif not self._poses.believable(tool):
            self._counts['jumps'] += 1
            self._trouble = 'the sensor jumps as no tip can'
        else:
            self._trouble = ''
            self._late_in_a_row = 0
            latency_ns = round(self._settings.latency * 1e9)
            self._keep(
                TrackerReading(measured - latency_ns, tool.frame, tool.position, tool.orientation),
                asked_ns,
            )

    def _follows(self, frame: int, asked_ns: int) -> bool:
        """Whether a frame can come after the last one at the time at which it was asked for."""
        ahead = self._clock.ahead_ns(frame, asked_ns)
        if self._frame is not None and frame < self._frame:
            self._counts['old frames'] += 1
            self._trouble = f'frame {frame} came after frame {self._frame}: an old reply'
        elif ahead > _AHEAD_NS:
            self._counts['frames ahead of time'] += 1
            self._trouble = f'frame {frame} came {ahead * 1e-6:.0f} ms before its time'
        else:
            self._misnumbered = 0
            return True
        self._misnumbered += 1
        if self._misnumbered >= _FOR_GOOD:
            raise DeviceError(
                f'tracker at {self._path} has restarted its frame count: it is reopened'
            )
        return False


def _handles(reply: str) -> list[int]:
    """Port handles of a reply to PHSR: a count, then handle and status of each."""
    try:
        count = int(reply[:2], 16)
        return [int(reply[2 + 5 * k : 4 + 5 * k], 16) for k in range(count)]
    except ValueError as error:
        raise DeviceError(f"tracker, PHSR: '{reply}' lists no port handles") from error
