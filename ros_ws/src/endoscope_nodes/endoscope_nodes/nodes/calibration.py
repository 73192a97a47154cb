"""Finds the tube's hysteresis class: moves the slave as calibration asks, judges its wires."""

import contextlib
from concurrent.futures import Future

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from threadpoolctl import threadpool_limits

from endoscope_core.calibration.calibration_run import (
    CALIBRATE,
    HOME,
    OrderCode,
    OrderFeedback,
    OrderState,
)
from endoscope_core.classifier.classification import Classifier, ClassifierError, UnseenTensionError
from endoscope_core.classifier.cnn_classifier import load_classifier
from endoscope_core.control import MotorLimits
from endoscope_core.judgement import Judgement, judged
from endoscope_core.orders import Ending, Order, Orders, Pose
from endoscope_core.safety import StateCommand
from endoscope_core.signals import CalibrationMotion, calibration_motion
from endoscope_nodes import names
from endoscope_nodes.client.calibration_result import (
    aborted_result,
    numbers_of,
    refused_result,
    successful_result,
)
from endoscope_nodes.client.graph_listener import feedback_message
from endoscope_nodes.runtime.diagnostics import OK, Report
from endoscope_nodes.runtime.endoscope_node import Beside, EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import CalibrationParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import COMMAND, EVENT, RESULT, SENSOR_ASKED
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.safety.sessions import SessionWatch
from endoscope_nodes.safety.streams import StreamWatch


class CalibrationNode(EndoscopeNode):
    """Serves ``calibration/run``, ``slave/home`` and ``home``; publishes ``calibration/result``.

    A service answers at once; how an order fares is on ``calibration/feedback``. Where it is
    aborted the slave holds or goes back to the master by a ramp, and the result says why. Tensions
    unlike any known are refused: nothing is compensated.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('calibration', context)
        p = self.parameters(CalibrationParameters)
        motion = calibration_motion(p.motion)
        classifier = _load_classifier(p.weights, motion)
        self._beside = Beside(self.ticker)

        def judge(tension: NDArray[np.float64]) -> Future[Judgement]:
            gear = self.rig.joints.gear
            return self._beside.submit(judged, classifier, motion, tension, gear, p.identify_plant)

        self.orders = Orders(
            self.rig,
            motion,
            judge,
            return_speed=p.return_speed,
            rest=p.rest,
            remedy=self.operate('set compensator.mode none'),
        )
        self._commands = JointPublisher(
            self, names.CALIBRATION_COMMAND, names.JOINTS, ('position', 'velocity'), COMMAND
        )
        self._results = self.create_publisher(DiagnosticArray, names.CALIBRATION_RESULT, RESULT)
        self._numbers = self.create_publisher(JointState, names.CALIBRATION_NUMBERS, RESULT)
        self._feedback = self.create_publisher(DiagnosticArray, names.CALIBRATION_FEEDBACK, RESULT)
        self._fed: OrderFeedback | None = None  # as published last
        self._session = SessionWatch(self, None, self._on_leave)
        self._pose = context.pose_of(self)
        self._wires = StreamWatch(self.ticker, names.WIRES_MEASURED)
        JointSubscription(self, names.WIRES_MEASURED, names.WIRES, self._on_wires, SENSOR_ASKED)
        JointSubscription(self, names.SLAVE_MEASURED, names.JOINTS, self._on_bending, SENSOR_ASKED)
        self.create_subscription(String, names.STATE_COMMAND, self._on_state_command, EVENT)
        self.serve(names.CALIBRATION_RUN, lambda: self._serve(CALIBRATE))
        self.serve(names.SLAVE_HOME, lambda: self._serve(HOME))
        self.diagnostics.add('procedure', self._report)
        self.ticker.add(self._on_tick)

    @property
    def active(self) -> bool:
        """Whether the slave is being moved for a calibration or home."""
        return self.orders.order is not None

    def _serve(self, order: str) -> tuple[bool, str]:
        refusal = self._begin(order)
        return not refusal, refusal or f'begun; {names.CALIBRATION_FEEDBACK} says how it fares'

    def _on_state_command(self, message: String) -> None:
        if message.data == StateCommand.HOME:
            self._begin(HOME)

    def _begin(self, name: str) -> str:
        """Begin an order, or say why not."""
        pose, now = self._where, self.ticker.now_ns()
        given = self.orders.begin(name, now, self._session.name, pose, self._silent(pose))
        if given.state is OrderState.REJECTED:
            self._feedback.publish(feedback_message(given, now))
            self.get_logger().warning(self.orders.last)
            return given.words
        self._commands.session = self._session.name
        self._feed()
        self.diagnostics.publish()
        return ''

    @property
    def _where(self) -> Pose:
        pose = self._pose
        return Pose(pose.shafts(), pose.bending() if pose.tracks else None)

    def _silent(self, pose: Pose) -> str:
        if pose.shafts is None:
            return f'{names.MOTOR_MEASURED} is silent or not finite'
        return self._wires.trouble(self.rig.timeouts.stream_ns)

    def _on_wires(self, sample: JointSample) -> None:
        if len(sample.effort) == len(names.WIRES):
            self._wires.note()
            self.orders.add_tension(sample.stamp_ns, sample.effort)

    def _on_bending(self, sample: JointSample) -> None:
        self.orders.add_bending(sample.stamp_ns, sample.position)

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        order = self.orders.order
        if order is None:
            self._feed()
            return
        pose = self._where
        self._end(order, self.orders.doubted(self._silent(pose)))
        command = self.orders.command(stamp_ns, periods)
        if command is not None:
            self._commands.publish(stamp_ns, *command.position, *command.velocity)
        self._feed()
        self._end(order, self.orders.ended(pose))

    def _on_leave(self) -> None:
        order = self.orders.order
        ended = self.orders.abort('the motion session has ended', OrderCode.SESSION_ENDED)
        if order is not None:
            self._end(order, ended)

    def _feed(self) -> None:
        """Say how the order that is obeyed fares, if that has changed."""
        if self.orders.feedback is not self._fed:
            self._fed = self.orders.feedback
            self._feedback.publish(feedback_message(self._fed, self.ticker.now_ns()))

    def _end(self, order: Order, ending: Ending | None) -> None:
        """Say at once what has come of an order, and why it was aborted, if it was."""
        if ending is None:
            return
        if order.name == CALIBRATE:
            result = self._result(order, ending)
            result.header.frame_id = self._commands.session
            self._results.publish(result)
            self._numbers.publish(numbers_of(result))
        self._feed()
        self.diagnostics.publish()
        if ending.code:
            self.get_logger().error(ending.log)
        elif ending.log:
            self.get_logger().info(ending.log)

    def _result(self, order: Order, ending: Ending) -> DiagnosticArray:
        now = self.ticker.now_ns()
        duration = (now - order.began_ns) * 1e-9
        if ending.judgement is not None:
            limits, found = MotorLimits.of(self.rig), ending.judgement
            return successful_result(now, found, ending.backlash, duration, limits, ending.zeros)
        if ending.code is OrderCode.UNKNOWN_TUBE:
            return refused_result(now, ending.reason, duration, ending.zeros)
        return aborted_result(now, ending.reason, str(order.run.step), duration)

    def _report(self) -> Report:
        orders = self.orders
        values: dict[str, object] = {
            'completed': orders.completed,
            'aborted': orders.aborted,
            'refused': orders.refused,
            'last': orders.last,
            'peak tension [N]': orders.guard.peak,
        }
        if orders.order is None:
            return OK, 'waiting', values
        values['progress'] = orders.order.run.progress
        return OK, str(orders.order.run.step), values

    def close(self) -> None:
        """Let the classifier's thread end."""
        self._beside.close()


def _load_classifier(weights: str, motion: CalibrationMotion) -> Classifier:
    # The threads of one judgement would stand in the way of the other nodes.
    threadpool_limits(1, 'blas')
    try:
        classifier = load_classifier(weights or None, motion.name)
    except ClassifierError as error:
        raise ParameterError(f"calibration: parameter 'weights': {error}") from error
    # The first judgement sets up memory, which takes longer than a tick. What it says of no
    # tension at all does not matter.
    with contextlib.suppress(UnseenTensionError):
        classifier.classify(np.zeros((motion.samples, len(names.WIRES))))
    return classifier
