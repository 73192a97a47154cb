"""The message ``calibration/feedback``: how an order to calibrate or to go home fares."""

from dataclasses import asdict, dataclass

from diagnostic_msgs.msg import DiagnosticArray

from endoscope_nodes.runtime.diagnostics import ERROR, OK, diagnostic_array, status

CALIBRATE, HOME = 'calibrate', 'home'
# States, as those of a ROS action's goal are called; no order was given yet in the first.
WAITING, EXECUTING, SUCCEEDED = 'waiting', 'executing', 'succeeded'
ABORTED, REJECTED = 'aborted', 'rejected'
# Why an order was rejected or aborted.
BUSY, NO_SESSION, SESSION_ENDED = 'busy', 'no_session', 'session_ended'
TENSION_CEILING, STREAM_SILENT, TENSION_GAP = 'tension_ceiling', 'stream_silent', 'tension_gap'
UNKNOWN_TUBE, NOT_JUDGED, NOT_REACHED = 'unknown_tube', 'not_judged', 'not_reached'


@dataclass(frozen=True)
class OrderFeedback:
    """How an order fares, by codes."""

    order: str = ''  # `CALIBRATE` or `HOME`; empty before the first
    id: int = 0  # unique: the time in ns at which it was given, or just after it
    state: str = WAITING
    phase: str = ''  # what is done for it now
    progress: float = 0.0  # from 0 to 1
    code: str = ''  # why it was rejected or aborted
    words: str = ''  # the same for a person

    def message(self, stamp_ns: int) -> DiagnosticArray:
        """Write it, at a time in ns."""
        values = asdict(self)
        level = ERROR if self.state in (ABORTED, REJECTED) else OK
        return diagnostic_array(
            stamp_ns, status('calibration: order', level, values.pop('words'), values)
        )

    @classmethod
    def of_message(cls, message: DiagnosticArray) -> 'OrderFeedback':
        """Read it."""
        [said] = message.status
        texts = {item.key: item.value for item in said.values}
        return cls(
            texts['order'],
            int(texts['id']),
            texts['state'],
            texts['phase'],
            float(texts['progress']),
            texts['code'],
            said.message,
        )
