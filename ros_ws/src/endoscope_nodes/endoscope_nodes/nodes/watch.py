"""Watches whether the rig that moves still matches its plant, and reports it."""

from collections.abc import Callable
from datetime import UTC, datetime

import numpy as np
from std_msgs.msg import String
from threadpoolctl import threadpool_limits

from endoscope_core.errors import FileError
from endoscope_core.monitoring import DetectedChange, RigWatch
from endoscope_core.monitoring.rig_watch import BLOCK_S, LEARNT, WINDOWS
from endoscope_core.monitoring.thresholds import FALSE_ALARMS_PER_HOUR
from endoscope_core.physics import PlantDescription
from endoscope_nodes import names
from endoscope_nodes.nodes.rig_follower import STREAMS, RigFollower
from endoscope_nodes.runtime.diagnostics import OK, STALE, WARN, Report
from endoscope_nodes.runtime.node_context import NodeContext, adopted_plant, load_slave
from endoscope_nodes.runtime.node_parameters import WatchParameters
from endoscope_nodes.runtime.qos import EVENT

_SECOND = 1_000_000_000
_NAMED_S = 10.0
"""How long after an alarm its stage is waited for before the last seconds are kept."""
_SILENT_S = 1.0
# What is judged is learnt only once it is older than any change that is looked for.
_LEARNING_S = BLOCK_S * float(LEARNT + WINDOWS[-1])
_STREAMS = {
    'setpoint': (names.MOTOR_SETPOINT, names.MOTORS, ['position']),
    **STREAMS,
    'motor': (names.MOTOR_MEASURED, names.MOTORS, ['position', 'effort']),
}


class WatchNode(RigFollower[None]):
    """Tells on ``/diagnostics`` that the rig is no longer the one described: where, since when.

    An alarm stays until ``watch/restart`` or until another plant is in force, and has the recorder
    keep the last seconds.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('watch', context)
        p = self.parameters(WatchParameters)
        self._active = p.active
        self.diagnostics.add('rig', self._report)
        self.serve(names.WATCH_RESTART, self._restart)
        if not p.active:
            return
        own = load_slave("watch: parameter 'plant'", p.plant) if p.plant else None
        self._described = own or context.plant
        self._source = self._described_by = p.plant or context.plant_name
        self._wanted = True
        self._newest_s = 0.0
        self._heard_ns = self.ticker.monotonic_ns()
        self._alarms: dict[str, DetectedChange] = {}
        self._kept: set[str] = set()
        # Of small matrices: threads for each would stand in the way of the other nodes.
        threadpool_limits(1, 'blas')
        # Compiled here rather than beside the ticks.
        self.rig_watch = _compiled(self._described)
        self._marks = self.create_publisher(String, names.RECORDER_MARK, EVENT)
        self._follow(_STREAMS, BLOCK_S)

    @property
    def announcement(self) -> str:
        """Say that it watches."""
        return f'watching for a rig other than {self._source}' if self._active else ''

    def _restart(self) -> tuple[bool, str]:
        if not self._active:
            return False, "the watch is off: parameter 'active' switches it on"
        self._wanted = True
        return True, 'learns anew'

    def _next(self) -> Callable[[], None]:
        if not self._wanted:
            return self._judge
        self._wanted = False
        self._alarms, self._kept = {}, set()
        return self._begin

    def _begin(self) -> None:
        """Learn anew, with the plant in force."""
        plant, self._source = self._described, self._described_by
        try:
            adopted = adopted_plant(self._adopted.plant)
        except FileError as error:
            self.get_logger().error(f'goes on with the described plant: {error}')
        else:
            if adopted is not None:
                plant, self._source = adopted, f'adopted plant {self._adopted.hash}'
        self._forget()
        self.rig_watch = RigWatch(plant)

    def _judge(self) -> None:
        newest = self._pass_on(self.rig_watch)
        if 'motor' in newest:
            self._heard_ns = self.ticker.monotonic_ns()
            self._newest_s = newest['motor']
            self.rig_watch.update(self._newest_s)

    def _take(self, _: None) -> None:
        """Say what is new, and have the recorder keep what led to it."""
        news = False
        for alarm in self.rig_watch.alarms:
            if self._alarms.get(alarm.joint) != alarm:
                self._alarms[alarm.joint] = alarm
                self.get_logger().warning(self._in_words(alarm))
                news = True
            late = self._newest_s > alarm.at + _NAMED_S
            if alarm.joint not in self._kept and (alarm.parts or late):
                self._kept.add(alarm.joint)
                self._marks.publish(String(data=f'watch: {self._in_words(alarm)}'))
        if news:
            self.diagnostics.publish()

    def _in_words(self, alarm: DetectedChange) -> str:
        return f'{alarm}, since {self._utc(alarm.since)}, margin {alarm.margin:.1f}'

    def _utc(self, seconds: float) -> str:
        return f'{datetime.fromtimestamp(seconds + self._origin_ns * 1e-9, UTC):%H:%M:%S} UTC'

    def _report(self) -> Report:
        if not self._active:
            return OK, 'off', {}
        watch = self.rig_watch
        values: dict[str, object] = {
            'plant': self._source,
            'margin': watch.margin,
            'false alarms an hour': FALSE_ALARMS_PER_HOUR,
            'begun anew': watch.restarts,
            'because': watch.restarted_because,
        }
        for joint in watch.joints:
            values[f'{joint.name} learnt [s]'] = BLOCK_S * min(joint.test.learnt, LEARNT)
        for name, stream in self._streams.items():
            values[f'{name} unreadable'] = stream.unreadable
        for alarm in self._alarms.values():
            values |= {
                f'{alarm.joint} told at': self._utc(alarm.at),
                f'{alarm.joint} since': self._utc(alarm.since),
                f'{alarm.joint} stage': ' or '.join(alarm.parts),
                f'{alarm.joint} change': alarm.change,
                f'{alarm.joint} margin': alarm.margin,
            }
        if self._alarms:
            return WARN, '; '.join(map(self._in_words, self._alarms.values())), values
        if self.ticker.monotonic_ns() - self._heard_ns > _SILENT_S * _SECOND:
            return STALE, f'nothing is heard of {names.MOTOR_MEASURED}', values
        if not watch.ready:
            moved = min(_LEARNING_S, BLOCK_S * min(joint.moved for joint in watch.joints))
            words = f'{names.LEARNING}, {moved:.0f} of {_LEARNING_S:.0f} s: every joint has to move'
            return OK, words, values
        return OK, f'the rig is as described by {self._source}', values


def _compiled(plant: PlantDescription) -> RigWatch:
    """A watch, once all that it calls is compiled."""
    watch = RigWatch(plant)
    time = np.linspace(0.0, 2.0 * BLOCK_S, 1000)
    for samples in (watch.setpoint, watch.motor):
        samples.append(time, np.zeros((len(time), samples.columns)))
    watch.update(2.0 * BLOCK_S)
    return RigWatch(plant)
