"""Finds the tube's hysteresis class: moves the slave as calibration asks, judges its wires."""

import contextlib
import dataclasses
from concurrent.futures import Future
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from threadpoolctl import threadpool_limits

from endoscope_core.calibration import (
    BendingRecord,
    CalibrationRun,
    CalibrationStep,
    TensionGapError,
    zero_errors,
)
from endoscope_core.classifier.classification import (
    Classifier,
    ClassifierError,
    UnseenTensionError,
)
from endoscope_core.classifier.weights_file import load_classifier
from endoscope_core.control import MotorLimits
from endoscope_core.identification.plant_fit import PlantFitError
from endoscope_core.judgement import Judgement, judged
from endoscope_core.safety import StateCommand, TensionGuard
from endoscope_core.safety.guards import TOLD_RAD
from endoscope_core.signals import SINUSOID, calibration_motion
from endoscope_nodes import names
from endoscope_nodes.client.calibration_result import (
    aborted_result,
    lost_in_words,
    numbers_of,
    refused_result,
    successful_result,
    with_zeros,
)
from endoscope_nodes.client.order_feedback import (
    CALIBRATE,
    HOME,
    OrderCode,
    OrderFeedback,
    OrderState,
)
from endoscope_nodes.runtime.beside import Beside
from endoscope_nodes.runtime.diagnostics import OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import CalibrationParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import COMMAND, EVENT, RESULT, SENSOR_ASKED
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.runtime.ticker import TICK_NS
from endoscope_nodes.safety.sessions import SessionWatch
from endoscope_nodes.safety.streams import StreamWatch

_FED_NS = 100_000_000


class CalibrationNode(EndoscopeNode):
    """Serves ``calibration/run`` and the ``home`` command; publishes ``calibration/result``.

    The service answers at once, with the reason if it refuses. How far an order is follows on
    ``calibration/feedback``, the result on its topic, and as numbers for programs that plot.
    Whatever makes the recording worthless or motion doubtful aborts: the commands stop, the
    slave holds or goes back to the master by a ramp, and the result says why. Tensions unlike
    any known are refused: the result names no class, and nothing is compensated.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('calibration', context)
        p = self.parameters(CalibrationParameters)
        self._settings = p
        self._timeout_ns = self.rig.timeouts.stream_ns
        self._motion = calibration_motion(p.motion)
        self._beyond_reach = self._reach_exceeded()
        self._classifier = self._load_classifier(p.weights)
        self._beside = Beside(self.ticker)
        self._run: CalibrationRun | None = None
        self._homing = False
        self._began_ns = 0
        self._bending = BendingRecord(len(names.JOINTS))
        self._judging: Future[Judgement] | None = None
        self._zeros = np.zeros(len(names.WIRES))
        self._runs = 0
        self._aborts = 0
        self._refused = 0
        self._last = ''
        self._order = OrderFeedback()
        self._newest = 0
        self._fed_ns = 0
        self._guard = TensionGuard(names.WIRES, self.rig.tension.calibration_ceiling)
        self._commands = JointPublisher(
            self, names.CALIBRATION_COMMAND, names.JOINTS, ('position', 'velocity'), COMMAND
        )
        self._results = self.create_publisher(DiagnosticArray, names.CALIBRATION_RESULT, RESULT)
        self._numbers = self.create_publisher(JointState, names.CALIBRATION_NUMBERS, RESULT)
        self._feedback = self.create_publisher(DiagnosticArray, names.CALIBRATION_FEEDBACK, RESULT)
        self._session = SessionWatch(self, None, self._on_leave)
        self._pose = context.pose_of(self)
        self._wires = StreamWatch(self.ticker, names.WIRES_MEASURED)
        JointSubscription(self, names.WIRES_MEASURED, names.WIRES, self._on_wires, SENSOR_ASKED)
        JointSubscription(self, names.SLAVE_MEASURED, names.JOINTS, self._on_bending, SENSOR_ASKED)
        self.create_subscription(String, names.STATE_COMMAND, self._on_state_command, EVENT)
        self.serve(names.CALIBRATION_RUN, self._calibrate)
        self.diagnostics.add('procedure', self._report)
        self.ticker.add(self._on_tick)

    @property
    def active(self) -> bool:
        """Whether the slave is being moved for a calibration or home."""
        return self._run is not None

    def _reach_exceeded(self) -> str:
        """Say that the motion needs more than the reach; empty where it does not."""
        # A smaller motion is no way out: the classifier knows the tensions of this one alone.
        reach, amplitude = self.rig.joints.reach, self._motion.amplitude
        if amplitude <= reach:
            return ''
        return (
            f'a calibration takes every joint {amplitude:.4g} rad either way, beyond joints.reach '
            f'{reach:g} of the rig; raise joints.reach where the instrument may be bent that far, '
            f'or work without calibration (`{self.operate("set compensator.mode none")}`)'
        )

    def _load_classifier(self, weights: str) -> Classifier:
        # The threads of one judgement would stand in the way of the other nodes.
        threadpool_limits(1, 'blas')
        try:
            classifier = load_classifier(weights or None, self._motion.name)
        except ClassifierError as error:
            raise ParameterError(f"calibration: parameter 'weights': {error}") from error
        # The first judgement sets up memory, which takes longer than a tick. What it says of no
        # tension at all does not matter.
        with contextlib.suppress(UnseenTensionError):
            classifier.classify(np.zeros((self._motion.samples, len(names.WIRES))))
        return classifier

    def _calibrate(self) -> tuple[bool, str]:
        refusal = self._start(homing=False)
        return not refusal, refusal or f'begun; {names.CALIBRATION_FEEDBACK} says how it fares'

    def _on_state_command(self, message: String) -> None:
        if message.data == StateCommand.HOME:
            self._start(homing=True)

    def _tell(self, last: str, code: OrderCode = OrderCode.NONE) -> None:
        """Say at once what has come of a procedure, and why it was aborted, if it was."""
        self._last = last
        self._feed(
            state=OrderState.ABORTED if code else OrderState.SUCCEEDED,
            code=code,
            progress=1.0,
            words=last,
        )
        self.diagnostics.publish()

    def _feed(self, **changes: Any) -> None:
        """Say how the order that is obeyed fares."""
        self._order = dataclasses.replace(self._order, phase=self._phase, **changes)
        self._fed_ns = self.ticker.now_ns()
        self._feedback.publish(self._order.message(self._fed_ns))

    @property
    def _phase(self) -> str:
        if self._run is None:
            return ''
        step = self._run.step
        return 'judging' if step is CalibrationStep.DONE else step.name.lower()

    def _start(self, homing: bool) -> str:
        """Begin, or say why not."""
        trouble, code = self._obstacle(homing)
        shafts = self._pose.shafts()
        now = self.ticker.now_ns()
        # Several may be given in one instant of simulated time.
        self._newest = max(self._newest + 1, now)
        order = OrderFeedback(HOME if homing else CALIBRATE, self._newest)
        if trouble or shafts is None:
            rejected = dataclasses.replace(
                order, state=OrderState.REJECTED, code=code, words=trouble
            )
            self._feedback.publish(rejected.message(now))
            self._last = f'{order.order}: {trouble}'
            self.get_logger().warning(self._last)
            return trouble
        self._order, self._began_ns = order, now
        self._commands.session = self._session.name
        self._run = CalibrationRun(
            self.rig.joints.entry([x / self.rig.joints.gear for x in shafts]),
            len(names.WIRES),
            TICK_NS,
            self._settings.return_speed,
            self._settings.rest,
            homing,
            self._motion,
        )
        self._homing = homing
        self._bending = BendingRecord(len(names.JOINTS))
        self._judging = None
        self._feed(state=OrderState.EXECUTING, words=str(self._run.step))
        self.diagnostics.publish()
        return ''

    def _obstacle(self, homing: bool) -> tuple[str, OrderCode]:
        """Why nothing can begin, in words (empty where it can) and as a code."""
        if self._run is not None:
            return f'busy: {self._run.step}', OrderCode.BUSY
        if not homing and self._beyond_reach:
            return self._beyond_reach, OrderCode.BEYOND_REACH
        if not self._session.name:
            return 'no motion session is open: the slave has to be ENABLED', OrderCode.NO_SESSION
        return self._trouble(), self._code_of_trouble()

    def _code_of_trouble(self) -> OrderCode:
        return OrderCode.TENSION_CEILING if self._guard.trouble else OrderCode.STREAM_SILENT

    def _trouble(self) -> str:
        if self._guard.trouble:
            return self._guard.trouble
        if self._pose.shafts() is None:
            return f'{names.MOTOR_MEASURED} is silent or not finite'
        return self._wires.trouble(self._timeout_ns)

    def _on_leave(self) -> None:
        self._abort('the motion session has ended', OrderCode.SESSION_ENDED)

    def _on_wires(self, sample: JointSample) -> None:
        if len(sample.effort) != len(names.WIRES):
            return
        self._wires.note()
        self._guard.update(sample.effort)
        if self._run is not None:
            self._run.add_tension(sample.stamp_ns, sample.effort)

    def _on_bending(self, sample: JointSample) -> None:
        if self._run is not None and len(sample.position) == len(names.JOINTS):
            self._bending.add(sample.stamp_ns, sample.position)

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        run = self._run
        if run is None:
            if not self._fed_ns:
                self._feed()
            return
        trouble = self._trouble()
        if trouble:
            self._abort(trouble, self._code_of_trouble())
            return
        command = run.command(stamp_ns, periods)
        if command is not None:
            self._commands.publish(stamp_ns, *command.position, *command.velocity)
        if self._phase != self._order.phase or stamp_ns - self._fed_ns >= _FED_NS:
            self._feed(words=str(run.step), progress=run.progress)
        if run.record is not None and run.record.complete and self._judging is None:
            self._judge(run)
        if self._run is not None and run.step is CalibrationStep.DONE:
            self._finish(run)

    def _judge(self, run: CalibrationRun) -> None:
        if run.record is None:
            return
        try:
            tension = run.record.resampled()
        except TensionGapError as error:
            self._abort(str(error), OrderCode.TENSION_GAP)
            return
        self._zeros = zero_errors(tension)
        self._judging = self._beside.submit(
            judged,
            self._classifier,
            self._motion,
            tension,
            self.rig.joints.gear,
            self._settings.identify_plant,
        )

    def _finish(self, run: CalibrationRun) -> None:
        if self._homing:
            self._finish_homing()
            return
        if self._judging is None:
            if run.record is None or not run.record.complete:
                self._abort('the tensions of the last samples did not come', OrderCode.TENSION_GAP)
            return
        if not self._judging.done():
            return
        trouble = self._judging.exception()
        if isinstance(trouble, UnseenTensionError):
            self._refuse(str(trouble))
            return
        if isinstance(trouble, ClassifierError | PlantFitError):
            self._abort(str(trouble), OrderCode.NOT_JUDGED)
            return
        found = self._judging.result()
        backlash = None
        # Backlash size is that under the sinusoid: faster motion has a wider loop.
        if run.record is not None and self._motion.name == SINUSOID:
            backlash = self._bending.backlash_size(run.record.start_ns)
        now = self.ticker.now_ns()
        duration = (now - self._began_ns) * 1e-9
        self._publish(
            successful_result(
                now,
                found.verdict,
                backlash,
                duration,
                MotorLimits.of(self.rig),
                found.plants,
                self._zeros,
                found.lost,
            )
        )
        self._run = None
        self._runs += 1
        named = f'class {found.verdict.class_deg} deg{lost_in_words(found.lost)}'
        self._tell(with_zeros(named, self._zeros))
        self.get_logger().info(f'{self._last}, probability {found.verdict.probability:.3f}')

    def _finish_homing(self) -> None:
        """Say that the slave is home where its shafts are, and only there."""
        shafts = self._pose.shafts() or ()
        away = {name: x for name, x in zip(names.MOTORS, shafts, strict=False) if abs(x) > TOLD_RAD}
        self._run = None
        if shafts and not away:
            self._tell(self._at_home())
            return
        self._aborts += 1
        where = ' and '.join(f'{name} at {x:.3f} rad' for name, x in away.items())
        self._tell(
            f'home is not reached: {where or "nothing measured"} instead of 0',
            OrderCode.NOT_REACHED,
        )
        self.get_logger().error(self._last)

    def _at_home(self) -> str:
        """What home is: by its friction the tube holds the tip where the wires left it."""
        bending = self._pose.bending()
        if not self._pose.tracks or bending is None:
            return 'home reached: motors at zero'
        furthest = max(np.degrees(np.abs(bending)))
        return f'home reached: motors at zero; the tip is at {furthest:.0f} deg, the tube holds it'

    def _refuse(self, reason: str) -> None:
        self._run = None
        self._refused += 1
        self._tell(with_zeros(reason, self._zeros), OrderCode.UNKNOWN_TUBE)
        self.get_logger().error(f'{self._last}; the motion is not compensated')
        now = self.ticker.now_ns()
        duration = (now - self._began_ns) * 1e-9
        self._publish(refused_result(now, reason, duration, self._zeros))

    def _publish(self, result: DiagnosticArray) -> None:
        result.header.frame_id = self._commands.session
        self._results.publish(result)
        self._numbers.publish(numbers_of(result))

    def _abort(self, reason: str, code: OrderCode) -> None:
        run, self._run = self._run, None
        if run is None:
            return
        self._aborts += 1
        self.get_logger().error(f'aborted while {run.step}: {reason}')
        self._tell(
            f'aborted while {run.step}: {reason}' if self._homing else f'aborted: {reason}', code
        )
        if not self._homing:
            now = self.ticker.now_ns()
            self._publish(aborted_result(now, reason, str(run.step), (now - self._began_ns) * 1e-9))

    def _report(self) -> Report:
        values: dict[str, object] = {
            'completed': self._runs,
            'aborted': self._aborts,
            'refused': self._refused,
            'last': self._last,
            'peak tension [N]': self._guard.peak,
        }
        if self._run is None:
            return OK, 'waiting', values
        values['progress'] = self._run.progress
        return OK, str(self._run.step), values

    def close(self) -> None:
        """Let the classifier's thread end."""
        self._beside.close()
