"""The compensator's part in adopting plants: who may ask, trial, and the plant before."""

import dataclasses
from collections.abc import Callable
from concurrent.futures import Future

from diagnostic_msgs.msg import DiagnosticArray

from endoscope_core.calibration.calibration_run import OrderState
from endoscope_core.choices import BY_ADOPTED, PHYSICAL
from endoscope_core.compensation.law_in_force import LawInForce, Selection
from endoscope_core.control import AdoptedPlant, AdoptionError, adopted_plant
from endoscope_core.safety import AdoptionCode
from endoscope_nodes import names
from endoscope_nodes.client.plant_adoption import AdoptionRequest, PlantInForce, Reach
from endoscope_nodes.runtime.endoscope_node import Beside, EndoscopeNode
from endoscope_nodes.runtime.node_parameters import FOR_SESSION
from endoscope_nodes.runtime.qos import EVENT, RESULT
from endoscope_nodes.safety.sessions import SessionWatch

_LOOK_S = 0.05


class PlantAdoption:
    """Answers ``compensator/adopt``, and says on ``compensator/plant`` what is in force.

    A request is obeyed in its motion session, from one sender, and at rest when it comes and once
    the plant has been tried: `check_rest` raises an AdoptionError. `select` changes the selection.
    """

    def __init__(
        self,
        node: EndoscopeNode,
        session: SessionWatch,
        law: LawInForce,
        check_rest: Callable[[AdoptedPlant | None], None],
        select: Callable[[Selection], None],
    ) -> None:
        self._node, self._session, self._law = node, session, law
        self._check_rest, self._select = check_rest, select
        self._request: AdoptionRequest | None = None
        self._trying: Future[AdoptedPlant] | None = None
        self._beside = Beside(node.ticker)
        self._answer = PlantInForce()
        self._pending = True
        self._out = node.create_publisher(DiagnosticArray, names.COMPENSATOR_PLANT, RESULT)
        requests = node.create_subscription(
            DiagnosticArray, names.COMPENSATOR_ADOPT, self._on_request, EVENT
        )
        self._senders = session.senders_of(requests, self._on_competing)
        node.ticker.every(_LOOK_S, self._look)

    def publish(self) -> None:
        """Say anew what is in force."""
        self._pending = True

    def close(self) -> None:
        """Let the thread end in which plants are tried."""
        self._beside.close()

    def _on_competing(self, competing: str) -> None:
        """A second sender moves nothing, and neither does the first while he is there."""
        if self._request is not None:
            self._reject(self._request, AdoptionError(AdoptionCode.OTHER_SENDER, competing))

    def _on_request(self, message: DiagnosticArray) -> None:
        request = AdoptionRequest.of_message(message)
        if request is None:
            self._node.get_logger().warning(f'{names.COMPENSATOR_ADOPT} is no request: ignored')
            return
        if request.id == self._answer.id:
            if self._request is not None:
                withdrawn = AdoptionError(AdoptionCode.WITHDRAWN, 'withdrawn: it took too long')
                self._reject(self._request, withdrawn)
            return
        try:
            self._check(request)
            if not request.plant:
                self._undo(request)
                return
        except AdoptionError as error:
            self._reject(request, error)
            return
        self._request = request
        self._say(request, OrderState.EXECUTING, 'trying the plant')
        self._trying = self._beside.submit(
            adopted_plant, request.plant, self._node.rig, names.JOINTS
        )

    def _check(self, request: AdoptionRequest) -> None:
        """Refuse who may not ask, or asks at the wrong time."""
        competing = self._senders.rivals()
        if competing:
            raise AdoptionError(AdoptionCode.OTHER_SENDER, competing)
        self._check_session(request)
        if self._request is not None:
            raise AdoptionError(AdoptionCode.BUSY, 'busy: another plant is being tried')
        self._check_rest(None)

    def _check_session(self, request: AdoptionRequest) -> None:
        if not self._session.name:
            raise AdoptionError(
                AdoptionCode.NO_SESSION,
                'no motion session is open: the slave has to be ENABLED; '
                + self._node.operate('enable'),
            )
        if not self._session.belongs(request.session):
            raise AdoptionError(
                AdoptionCode.OTHER_SESSION,
                f'the request is of {request.session or "no session"}, and '
                f'{self._session.name} is open',
            )

    def _undo(self, request: AdoptionRequest) -> None:
        before = self._law.before
        if before is None:
            raise AdoptionError(
                AdoptionCode.NOTHING_TO_UNDO, 'no plant has been adopted: there is none before'
            )
        self._check_rest(before.plant)
        self._law.undo()
        self._select(before.selection)
        self._say(request, OrderState.SUCCEEDED, f'undone: {self._in_words()}')

    def _look(self) -> None:
        """Put a plant that has been tried into force, where that is still wanted."""
        request, trying = self._request, self._trying
        if request is not None and trying is not None and trying.done():
            self._request = self._trying = None
            try:
                plant = trying.result()
                self._check_session(request)
                self._check_rest(plant)
            except AdoptionError as error:
                self._reject(request, error)
            else:
                self._law.adopt(plant, self._node.get_parameter(FOR_SESSION).value)
                self._select(Selection(PHYSICAL, BY_ADOPTED))
                self._say(request, OrderState.SUCCEEDED, self._in_words())
        now = self._node.ticker.now_ns()
        if self._pending and now:
            self._pending = False
            self._publish()

    def _in_words(self) -> str:
        plant = self._law.plant
        if plant is None:
            return 'no plant has been adopted'
        left_out = ', '.join(plant.left_out)
        return f'plant {plant.hash} adopted' + (
            f' but for {left_out}, which the inverse does better without' if left_out else ''
        )

    def _reject(self, request: AdoptionRequest, error: AdoptionError) -> None:
        if request is self._request:
            self._request = self._trying = None
        self._say(request, OrderState.REJECTED, str(error), error.code)

    def _say(
        self,
        request: AdoptionRequest,
        state: OrderState,
        answer: str,
        code: AdoptionCode = AdoptionCode.NONE,
    ) -> None:
        # A place in the code that logs has one severity for ever.
        if code:
            self._node.get_logger().warning(answer)
        else:
            self._node.get_logger().info(answer)
        self._answer = PlantInForce(id=request.id, state=state, code=code, answer=answer)
        self._publish()

    def _publish(self) -> None:
        plant, before = self._law.plant, self._law.before
        in_force = dataclasses.replace(
            self._answer,
            plant='' if plant is None else plant.text,
            hash='' if plant is None else plant.hash,
            before='' if before is None or before.plant is None else before.plant.hash,
            left_out=() if plant is None else plant.left_out,
            words=self._in_words(),
            reach=Reach(*self._law.ranges) if self._law.ranges else None,
        )
        self._out.publish(in_force.message(self._node.ticker.now_ns(), self._session.name))
