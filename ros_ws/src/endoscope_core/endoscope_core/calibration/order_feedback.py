"""How an order to calibrate or to go home fares, by codes."""

from dataclasses import dataclass
from enum import StrEnum

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
    """How an order fares; its progress is relative, from 0 to 1."""

    order: str = ''  # `CALIBRATE` or `HOME`; empty before the first
    id: int = 0  # unique: the time in ns at which it was given, or just after it
    state: OrderState = OrderState.WAITING
    phase: str = ''  # what is done for it now
    progress: float = 0.0
    code: OrderCode = OrderCode.NONE  # why it was rejected or aborted
    words: str = ''  # the same for a person
