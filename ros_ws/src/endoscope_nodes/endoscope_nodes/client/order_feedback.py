"""The message ``calibration/feedback``: how an order to calibrate or to go home fares."""

from dataclasses import asdict

from diagnostic_msgs.msg import DiagnosticArray

from endoscope_core.calibration.order_feedback import OrderFeedback, OrderState
from endoscope_nodes.runtime.diagnostics import ERROR, OK, diagnostic_array, from_status, status


def feedback_message(feedback: OrderFeedback, stamp_ns: int) -> DiagnosticArray:
    """Write it, at a time in ns."""
    values = asdict(feedback)
    words = values.pop('words')
    level = ERROR if feedback.state in (OrderState.ABORTED, OrderState.REJECTED) else OK
    return diagnostic_array(stamp_ns, status('calibration: order', level, words, values))


def feedback_of(message: DiagnosticArray) -> OrderFeedback:
    """Read it."""
    [order] = message.status
    return from_status(OrderFeedback, order, words=order.message)
