"""The message ``calibration/feedback``: how an order to calibrate or to go home fares."""

from dataclasses import asdict

from diagnostic_msgs.msg import DiagnosticArray

from endoscope_core.calibration.order_feedback import OrderCode, OrderFeedback, OrderState
from endoscope_nodes.runtime.diagnostics import ERROR, OK, diagnostic_array, status


def feedback_message(feedback: OrderFeedback, stamp_ns: int) -> DiagnosticArray:
    """Write it, at a time in ns."""
    values = asdict(feedback)
    failed = feedback.state in (OrderState.ABORTED, OrderState.REJECTED)
    level = ERROR if failed else OK
    return diagnostic_array(
        stamp_ns, status('calibration: order', level, values.pop('words'), values)
    )


def feedback_of(message: DiagnosticArray) -> OrderFeedback:
    """Read it."""
    [status] = message.status
    texts = {item.key: item.value for item in status.values}
    return OrderFeedback(
        texts['order'],
        int(texts['id']),
        OrderState(texts['state']),
        texts['phase'],
        float(texts['progress']),
        OrderCode(texts['code']),
        status.message,
    )
