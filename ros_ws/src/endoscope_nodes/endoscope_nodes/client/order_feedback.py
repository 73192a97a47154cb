"""The message ``calibration/feedback``: how an order to calibrate or to go home fares."""

from dataclasses import asdict, dataclass
from enum import StrEnum

from diagnostic_msgs.msg import DiagnosticArray

from endoscope_nodes.runtime.diagnostics import ERROR, OK, diagnostic_array, status

CALIBRATE, HOME = 'calibrate', 'home'


class OrderState(StrEnum):
    """As the states of a ROS action's goal are called, and `WAITING` before the first order."""

    WAITING = 'waiting'
    EXECUTING = 'executing'
    SUCCEEDED = 'succeeded'
    ABORTED = 'aborted'
    REJECTED = 'rejected'


class OrderCode(StrEnum):
    """Why an order was rejected or aborted."""

    NONE = ''
    BUSY = 'busy'
    BEYOND_REACH = 'beyond_reach'
    NO_SESSION = 'no_session'
    SESSION_ENDED = 'session_ended'
    TENSION_CEILING = 'tension_ceiling'
    STREAM_SILENT = 'stream_silent'
    TENSION_GAP = 'tension_gap'
    UNKNOWN_TUBE = 'unknown_tube'
    NOT_JUDGED = 'not_judged'
    NOT_REACHED = 'not_reached'


@dataclass(frozen=True)
class OrderFeedback:
    """How an order fares, by codes."""

    order: str = ''  # `CALIBRATE` or `HOME`; empty before the first
    id: int = 0  # unique: the time in ns at which it was given, or just after it
    state: OrderState = OrderState.WAITING
    phase: str = ''  # what is done for it now
    progress: float = 0.0  # from 0 to 1
    code: OrderCode = OrderCode.NONE  # why it was rejected or aborted
    words: str = ''  # the same for a person

    def message(self, stamp_ns: int) -> DiagnosticArray:
        """Write it, at a time in ns."""
        values = asdict(self)
        failed = self.state in (OrderState.ABORTED, OrderState.REJECTED)
        level = ERROR if failed else OK
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
            OrderState(texts['state']),
            texts['phase'],
            float(texts['progress']),
            OrderCode(texts['code']),
            said.message,
        )
