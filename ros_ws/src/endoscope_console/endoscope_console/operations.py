"""Execution of the operator's orders."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from endoscope_console import orders
from endoscope_console.access import OPERATOR
from endoscope_console.alarms import Alarms
from endoscope_console.clients import Client
from endoscope_console.controls import Controls
from endoscope_console.explanations import Explanations
from endoscope_console.graph_side import ANSWER_S, Settings, identified
from endoscope_console.investigations import AskedMotion, Investigations
from endoscope_console.investigations import Consent as AskOperator
from endoscope_console.playing import Holder
from endoscope_console.teleop.operator import DeadManState
from endoscope_core.choices import PHYSICAL
from endoscope_core.errors import EndoscopeError, NotPlayedError
from endoscope_nodes.client.plant_adoption import RefusedAdoptionError, plant_text
from endoscope_nodes.names import RECORDER_START, RECORDER_STOP
from endoscope_nodes.runtime.node_parameters import CompensatorParameters

_WAITING_ORDERS = 16
_NO_LEASE = (
    orders.Claim,
    orders.Release,
    orders.Bags,
    orders.Explain,
    orders.Cancel,
    orders.Acknowledge,
)
_WHERE_NOBODY_OPERATES = (orders.Record, orders.Mark, orders.StopInvestigation)
_NOT_MEANWHILE = (orders.Set, orders.Record, orders.Adopt)
"""While a motion of an investigation is recorded as it is commanded."""


@dataclass
class Operations:
    """Obeys orders, one operator's at a time; lives in the thread of the sockets."""

    controls: Controls
    explanations: Explanations
    investigations: Investigations
    alarms: Alarms

    def __post_init__(self) -> None:
        self._graph, self._ask = self.controls.graph, self.controls.ask
        self._consented: Client | None = None

    async def obey(self, client: Client, order: orders.Order) -> dict[str, Any]:
        """Carry out a client's order; returns the answer, with the outcome in `ok` and `why`."""
        answer: dict[str, Any] = {}
        try:
            self._check(client, order)
            outcome = await self._carry_out(client, order)
            if isinstance(outcome, str):
                why = outcome
            else:
                why, answer = '', dict(outcome)
            ok = True
        except EndoscopeError as error:
            why, ok = str(error), False
            if isinstance(error, RefusedAdoptionError):
                answer = {'code': error.code}
            self.controls.counts['refused: orders'] += 1
        # Viewers could fill the recording with refused orders.
        if client.role == OPERATOR and not isinstance(order, orders.Bags):
            self._graph.log(orders.in_words(order), client.id, client.address, ok, why)
        return {'op': 'answer', 'id': order.id, 'ok': ok, 'why': why, **answer}

    def _check(self, client: Client, order: orders.Order) -> None:
        if client.role != OPERATOR:
            raise EndoscopeError('a viewer only looks on')
        if self.controls.playing.investigates and isinstance(order, _NOT_MEANWHILE):
            raise EndoscopeError('a motion of an investigation is under way')
        if isinstance(order, _NO_LEASE) or client.id == self.controls.lease.holder:
            return
        # Ending motion is never wrong, whoever has the controls.
        if isinstance(order, orders.StateOrder) and order.command in orders.HALTS:
            return
        holder = self.controls.operator
        if isinstance(order, _WHERE_NOBODY_OPERATES) and not self.controls.lease.holder:
            return
        who = 'nobody operates: take the controls first'
        raise EndoscopeError(f'{holder.label} operates' if holder else who)

    async def _carry_out(self, client: Client, order: orders.Order) -> str | Mapping[str, Any]:
        match order:
            case orders.Claim():
                return await self.controls.claim(client, order.take)
            case orders.Release():
                return self.controls.release(client)
            case orders.StateOrder():
                return await self._state(order.command)
            case orders.Calibrate():
                return await self.controls.moving(
                    'calibration', partial(self._calibrate, self.controls.withdrawn())
                )
            case orders.Set():
                return await self._set(order)
            case orders.Record():
                service = RECORDER_START if order.on else RECORDER_STOP
                return await self._ask(partial(self._graph.client.trigger, service, ANSWER_S))
            case orders.Mark():
                bag = await self._ask(partial(self._graph.client.mark, order.reason, ANSWER_S))
                return f'kept as {Path(bag).name}'
            case orders.Acknowledge():
                self.alarms.acknowledge(order.alarm)
                return ''
            case orders.Bags():
                own = await self._ask(self._graph.plant)
                return await self._ask(self.explanations.listing) | {'own_plant': own}
            case orders.Explain():
                own = await self._ask(self._graph.plant)
                return await self.explanations.begin(
                    order.bag, order.plant, order.baseline, order.validate, own
                )
            case orders.Cancel():
                return await self.explanations.cancel(order.explanation)
            case orders.PlayExperiment():
                return await self._play(client, order.explanation)
            case orders.Adopt():
                return await self._adopt(order.plant)
            case orders.Investigate():
                return await self._investigate(order)
            case orders.Consent():
                if order.go:
                    self.controls.require_rest()
                # Another hand is no hand for it.
                self._consented = client
                return self.investigations.answer(order.question, order.go)
            case orders.StopInvestigation():
                return await self.investigations.stop(order.investigation, self._halt)

    async def _state(self, command: str) -> str:
        graph = self._graph.client
        if command in orders.HALTS:
            # At once: no thread has to be free for it, and what was asked for before is over.
            self.controls.count_halt(f'a person asked for {command}')
            graph.order(command)
            return await self._ask(partial(graph.ask, command, ANSWER_S))
        if self.controls.playing.prepares:
            raise EndoscopeError('the motion is being prepared: in a moment')
        withdrawn = self.controls.withdrawn()
        if command == 'home':
            return await self.controls.moving(command, partial(graph.home, ANSWER_S, withdrawn))
        return await self._ask(partial(graph.ask_and_see, command, ANSWER_S, withdrawn))

    def _calibrate(self, withdrawn: Callable[[], str]) -> str:
        if withdrawn():
            raise EndoscopeError('calibration was withdrawn before it began')
        client = self._graph.client
        first = client.calibration is None or client.calibration.level != 0
        found = client.calibrate(patience_s=ANSWER_S)
        wanted = '' if client.compensator is None else client.compensator.values.get('wanted_mode')
        # What somebody has chosen stays; and nothing changes under a hand, or after a halt.
        at_rest = not withdrawn() and self.controls.beat.report.state is not DeadManState.ENGAGED
        if first and at_rest and wanted == CompensatorParameters.mode and identified(found):
            self._graph.compensate(PHYSICAL)
            return f'{found.message}; the compensator is {PHYSICAL} now, and was {wanted}'
        return found.message

    async def _play(self, client: Client, explanation: str) -> str:
        """Have the master play an experiment for as long as the operator holds on."""
        file = self.explanations.experiment_of(explanation)
        if self.controls.holder.moves:
            raise EndoscopeError(f'{self.controls.holder.moves} is under way')
        if self._graph.client.state != 'ENABLED':
            raise EndoscopeError(f'the slave is {self._graph.client.state}: enable it first')
        still = partial(self.controls.holds, client)
        return await self.controls.playing.begin(self.controls.holder, still, file)

    async def _adopt(self, plant: str | None) -> str:
        """Put a plant into force, or the one before; returns the outcome."""
        self.controls.require_rest()
        text = '' if plant is None else plant_text(self.explanations.plant_file(plant))
        adopt = partial(self._graph.plants.adopt, text, ANSWER_S)
        return (await self._ask(adopt)).answer

    async def _investigate(self, order: orders.Investigate) -> Mapping[str, Any]:
        """Begin an investigation, which moves nothing before it has asked."""
        rig = await self._ask(self._graph.rig_file)
        play = self._play_asked
        if order.investigation is not None:
            one = self.investigations.resume(order.investigation, rig, order.experiments, play)
        else:
            own = await self._ask(self._graph.plant)
            one = self.investigations.begin(order.plant, own, rig, order.experiments, play)
        return {'investigation': one}

    async def _play_asked(self, motion: AskedMotion, ask: AskOperator) -> None:
        """Have a motion played under the hand of whoever consents to it."""

        def begins() -> tuple[Holder, Callable[[], str]]:
            if self._consented is not self.controls.operator or not self.controls.place.publishes:
                raise NotPlayedError('whoever consented has lost the controls')
            self.controls.require_rest()
            return self.controls.holder, self.controls.withdrawn()

        await self.controls.playing.motion(motion, ask, begins)

    def _halt(self) -> None:
        """End what an investigation moves."""
        self.controls.count_halt('a person ended it')
        if self._graph.client.state == 'ENABLED':
            self._graph.client.order('pause')

    async def _set(self, order: orders.Set) -> str:
        if order.scale is not None:
            if self.controls.beat.report.state is DeadManState.ENGAGED:
                raise EndoscopeError('the scale changes only while nothing is held')
            await self._ask(partial(self.controls.place.set_master, scale=order.scale))
            self._graph.settings = Settings(self._graph.settings.source, order.scale)
        elif order.compensator is not None:
            await self._ask(partial(self._graph.compensate, order.compensator))
        return ''

    async def close(self) -> None:
        """End the lease and give everything back."""
        self.controls.relieve()
        await self.investigations.close()
        await self.controls.close()
