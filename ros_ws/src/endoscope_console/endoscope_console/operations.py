"""What is done for the operator: the lease and every order."""

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from endoscope_console import orders
from endoscope_console.access import OPERATOR
from endoscope_console.alarms import Alarms
from endoscope_console.beat import Beat, Situation
from endoscope_console.clients import Client, Clients
from endoscope_console.explanations import Explanations
from endoscope_console.graph_side import PATIENCE_S, GraphSide, Settings, identified
from endoscope_console.handle_place import HandlePlace
from endoscope_console.investigations import AskedMotion, Investigations
from endoscope_console.investigations import Consent as AskOperator
from endoscope_console.playing import Holder, Playing
from endoscope_console.teleop.frames import InputFrame
from endoscope_console.teleop.lease import Attendance, Lease
from endoscope_console.teleop.operator import DeadManState, Reason
from endoscope_core.choices import FOLLOW_THE_HANDLE, PHYSICAL
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
_WHERE_NOBODY_OPERATES = (orders.Record, orders.Mark, orders.Stop)
_NOT_MEANWHILE = (orders.Set, orders.Record, orders.Adopt)
"""While a motion of an investigation is recorded as it is commanded."""


@dataclass
class Operations:
    """Obeys orders, one operator's at a time; lives in the thread of the sockets."""

    graph: GraphSide
    beat: Beat
    clients: Clients
    explanations: Explanations
    investigations: Investigations
    alarms: Alarms
    counts: Counter[str]  # of refusals
    lease: Lease = field(default_factory=Lease)  # of the one operator
    attendance: Attendance = field(default_factory=Attendance)  # of the session that is open

    def __post_init__(self) -> None:
        self._pool = ThreadPoolExecutor(_WAITING_ORDERS, thread_name_prefix='order')
        self._place = HandlePlace(self.graph, self.beat, self._ask)
        self.playing = Playing(self.graph, self._place, self._ask, self.soon)
        self._holder = Holder()
        self._halts = 0
        self._why_halted = ''
        self._consented: Client | None = None
        self._closing = False
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def holder(self) -> Client | None:
        """Who operates."""
        return self._holder.client if self.lease.holder else None

    def hear(self, client: Client, frame: InputFrame, arrived_ns: int) -> None:
        """Take a frame of a client's hand, that arrived at a steady time in ns."""
        if client.id != self.lease.holder:
            self.counts['frames of others'] += 1
            return
        self.lease.heard(client.id, arrived_ns)
        self.beat.hear(client.id, frame, arrived_ns)

    def refuse(self, client: Client, reason: Reason, now_ns: int) -> None:
        """Take what is none, at a steady time in ns."""
        self.counts[f'refused: {reason}'] += 1
        self.beat.refuse(client.id, reason, now_ns)

    def closed(self, client: Client) -> None:
        """Take note that a client is gone."""
        self.beat.refuse(client.id, Reason.CLOSED, time.monotonic_ns())
        if client.id == self.lease.holder:
            self.lease.release(client.id)
            self._lease_ended(client, 'its page was closed')

    def turn(self, now_ns: int) -> None:
        """End a silent lease, and tell the beat how things are; at a steady time in ns."""
        silent = self.lease.turn(now_ns)
        if silent and self._holder.client is not None:
            why = 'its page was silent for 2 s'
            self._holder.client.tell({'op': 'lost', 'by': '', 'why': why})
            self._lease_ended(self._holder.client, why)
        if self._holder.moves and not self._holder.waits and self.graph.client.underway is None:
            self._holder.moves = ''
        if self.playing.is_over():
            self.soon(self.playing.end(self._holder))
        client = self.graph.client
        session = client.session if client.state == 'ENABLED' else ''
        if self.attendance.turn(now_ns, session, not session or self._is_attended()):
            client.order('pause')
            self.graph.log('pause', '', '', True, 'nobody operates')
        self._tell_beat()

    def _is_attended(self) -> bool:
        """Whether anybody operates, here or by another program."""
        if self.lease.holder:
            return True
        other = self.graph.settings.source not in ('', FOLLOW_THE_HANDLE)
        return not self._place.speaks and (other or bool(self.graph.others_at_the_handle()))

    def _tell_beat(self) -> None:
        graph, pictures = self.graph, self.graph.pictures
        self.beat.situation = Situation(
            holder=self.lease.holder,
            speaks=self._place.speaks and bool(self.lease.holder),
            state_enabled=graph.client.state == 'ENABLED' and graph.ended is None,
            state_ns=graph.heard_ns,
            calibrating=graph.client.underway is not None,
            source=graph.settings.source if self._place.speaks else '',
            pictures=pictures.made,
            playing=self.playing.underway,
            session=graph.client.session,
            wanted=pictures.wanted,
            wanted_ns=pictures.wanted_ns,
            scale=graph.settings.scale,
        )

    async def obey(self, client: Client, order: orders.Order) -> dict[str, Any]:
        """Do what a client asks for; the answer, in which `ok` and `why` say what became of it."""
        answer: dict[str, Any] = {}
        try:
            self._check(client, order)
            told = await self._carry_out(client, order)
            if isinstance(told, str):
                why = told
            else:
                why, answer = '', dict(told)
            ok = True
        except EndoscopeError as error:
            why, ok = str(error), False
            if isinstance(error, RefusedAdoptionError):
                answer = {'code': error.code}
            self.counts['refused: orders'] += 1
        # A viewer could fill the recording with what is refused anyhow.
        if client.role == OPERATOR and not isinstance(order, orders.Bags):
            self.graph.log(orders.in_words(order), client.id, client.address, ok, why)
        return {'op': 'answer', 'id': order.id, 'ok': ok, 'why': why, **answer}

    def _check(self, client: Client, order: orders.Order) -> None:
        if client.role != OPERATOR:
            raise EndoscopeError('a viewer only looks on')
        if self.playing.investigates and isinstance(order, _NOT_MEANWHILE):
            raise EndoscopeError('a motion of an investigation is under way')
        if isinstance(order, _NO_LEASE) or client.id == self.lease.holder:
            return
        # Ending motion is never wrong, whoever has the controls.
        if isinstance(order, orders.State) and order.command in orders.HALTS:
            return
        holder = self.holder
        if isinstance(order, _WHERE_NOBODY_OPERATES) and not self.lease.holder:
            return
        who = 'nobody operates: take the controls first'
        raise EndoscopeError(f'{holder.label} operates' if holder else who)

    async def _carry_out(self, client: Client, order: orders.Order) -> str | Mapping[str, Any]:
        match order:
            case orders.Claim():
                return await self.claim(client, order.take)
            case orders.Release():
                return self._release(client)
            case orders.State():
                return await self._state(order.command)
            case orders.Calibrate():
                return await self._moving(
                    'calibration', partial(self._calibrate, self._withdrawn())
                )
            case orders.Set():
                return await self._set(order)
            case orders.Record():
                service = RECORDER_START if order.on else RECORDER_STOP
                return await self._ask(partial(self.graph.client.trigger, service, PATIENCE_S))
            case orders.Mark():
                bag = await self._ask(partial(self.graph.client.mark, order.reason, PATIENCE_S))
                return f'kept as {Path(bag).name}'
            case orders.Acknowledge():
                self.alarms.acknowledge(order.alarm)
                return ''
            case orders.Bags():
                own = await self._ask(self.graph.plant)
                return await self._ask(self.explanations.listing) | {'own_plant': own}
            case orders.Explain():
                own = await self._ask(self.graph.plant)
                return await self.explanations.begin(
                    order.bag, order.plant, order.baseline, order.validate, own
                )
            case orders.Cancel():
                return await self.explanations.cancel(order.explanation)
            case orders.Play():
                return await self._play(client, order.explanation)
            case orders.Adopt():
                return await self._adopt(order.plant)
            case orders.Investigate():
                return await self._investigate(order)
            case orders.Consent():
                if order.go:
                    self._require_rest()
                # Another hand is no hand for it.
                self._consented = client
                return self.investigations.answer(order.question, order.go)
            case orders.Stop():
                return await self.investigations.stop(order.investigation, self._halt)

    async def _ask[T](self, ask: Callable[[], T]) -> T:
        """Wait for the graph in a thread of the pool: the sockets go on meanwhile."""
        return await asyncio.get_running_loop().run_in_executor(self._pool, ask)

    async def claim(self, client: Client, take: bool) -> str:
        """Make a client the operator; what became of it."""
        if self._closing:
            raise EndoscopeError('the server of the page ends')
        if self._holds(client) and self._place.speaks:
            return ''
        claim = self.lease.claim(client.id, take, time.monotonic_ns())
        if not claim.granted:
            raise EndoscopeError(claim.why)
        if claim.lost_by:
            self._lost(claim.lost_by, client)
        if self._holder.client is not client:
            self._holder = Holder(client)
        self._tell_beat()
        async with self._place.lock:
            try:
                if not self._place.speaks:
                    await self._place.take(take)
            except BaseException:
                if self.lease.holder == client.id:
                    self.lease.release(client.id)
                    self._holder = Holder()
                    self._tell_beat()
                raise
            if self.lease.holder != client.id:
                self.soon(self._give_back())
                raise EndoscopeError('the controls were lost meanwhile')
            self._tell_beat()
        return ''

    def _lost(self, holder: str, to: Client) -> None:
        """Tell an operator that another took the lease."""
        self._end_what_moves(holder, 'another took the controls')
        lost = self.clients.by_id(holder)
        if lost is not None:
            lost.tell({'op': 'lost', 'by': to.label, 'why': f'{to.label} took the controls'})
            self.graph.log('lease', lost.id, lost.address, True, f'taken by {to.label}')

    def _release(self, client: Client) -> str:
        if client.id == self.lease.holder:
            self.lease.release(client.id)
            self._lease_ended(client, 'given back')
        return ''

    def _lease_ended(self, client: Client, why: str) -> None:
        self._end_what_moves(client.id, f'its operator lost the controls: {why}')
        self._holder = Holder()
        self._tell_beat()
        self.graph.log('lease', client.id, client.address, True, f'ended: {why}')
        self.soon(self._give_back())

    def _end_what_moves(self, holder: str, why: str) -> None:
        """Let nothing that an operator has begun or asked for go on without him."""
        self._count_halt(why)
        # He may hold the lease again before the next beat looks.
        self.beat.refuse(holder, Reason.LOST, time.monotonic_ns())
        if self._holder.moves:
            self.graph.client.order('pause')
        if self.playing.is_experiment:
            # The next operator's hand is no hand for what this one had played.
            self.soon(self.playing.end(self._holder))

    def soon(self, work: Coroutine[Any, Any, None]) -> None:
        """Let something be done beside all else, whose end is waited for at the end."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _give_back(self) -> None:
        """Leave the handle to others, unless somebody has taken the controls meanwhile."""
        async with self._place.lock:
            if self.lease.holder or not self._place.speaks:
                return
            self._place.speaks = False
            self._tell_beat()
            await self._ask(self.graph.plants.leave)
            await self._place.give_back()

    async def _state(self, command: str) -> str:
        graph = self.graph.client
        if command in orders.HALTS:
            # At once: no thread has to be free for it, and what was asked for before is over.
            self._count_halt(f'a person asked for {command}')
            graph.order(command)
            return await self._ask(partial(graph.ask, command, PATIENCE_S))
        if self.playing.prepares:
            raise EndoscopeError('the motion is being prepared: in a moment')
        withdrawn = self._withdrawn()
        if command == 'home':
            return await self._moving(command, partial(graph.home, PATIENCE_S, withdrawn))
        return await self._ask(partial(graph.ask_and_see, command, PATIENCE_S, withdrawn))

    def _count_halt(self, why: str) -> None:
        self._halts, self._why_halted = self._halts + 1, why

    def _withdrawn(self) -> Callable[[], str]:
        """What has ended motion since now, in words; empty for nothing."""
        halts = self._halts
        return lambda: '' if self._halts == halts else self._why_halted

    async def _moving(self, what: str, move: Callable[[], str]) -> str:
        """Have the slave moved, for as long as the client operates."""
        holder = self._holder
        if holder.moves:
            raise EndoscopeError(f'{holder.moves} is under way')
        if self.beat.said.state is DeadManState.ENGAGED:
            raise EndoscopeError('let go first: it moves the slave by itself')
        holder.moves, holder.waits = what, True
        try:
            told = await self._ask(move)
            holder.moves = ''
        finally:
            # A wait that timed out has not ended it.
            holder.waits = False
        return told

    def _calibrate(self, withdrawn: Callable[[], str]) -> str:
        if withdrawn():
            raise EndoscopeError('calibration was withdrawn before it began')
        client = self.graph.client
        first = client.calibration is None or client.calibration.level != 0
        found = client.calibrate(patience_s=PATIENCE_S)
        wanted = '' if client.compensator is None else client.compensator.values.get('wanted_mode')
        # What somebody has chosen stays; and nothing changes under a hand, or after a halt.
        at_rest = not withdrawn() and self.beat.said.state is not DeadManState.ENGAGED
        if first and at_rest and wanted == CompensatorParameters.mode and identified(found):
            self.graph.compensate(PHYSICAL)
            return f'{found.message}; the compensator is {PHYSICAL} now, and was {wanted}'
        return found.message

    async def _play(self, client: Client, explanation: str) -> str:
        """Have the master play an experiment for as long as the operator holds on."""
        file = self.explanations.experiment_of(explanation)
        if self._holder.moves:
            raise EndoscopeError(f'{self._holder.moves} is under way')
        if self.graph.client.state != 'ENABLED':
            raise EndoscopeError(f'the slave is {self.graph.client.state}: enable it first')
        still = partial(self._holds, client)
        return await self.playing.begin(self._holder, still, file)

    def _holds(self, client: Client) -> bool:
        return self.lease.holder == client.id

    async def _adopt(self, plant: str | None) -> str:
        """Put a plant into force, or the one before; what became of it."""
        self._require_rest()
        text = '' if plant is None else plant_text(self.explanations.plant_file(plant))
        adopt = partial(self.graph.plants.adopt, text, PATIENCE_S)
        return (await self._ask(adopt)).answer

    def _require_rest(self) -> None:
        if self._holder.moves:
            raise EndoscopeError(f'{self._holder.moves} is under way')
        if self.beat.said.state is DeadManState.ENGAGED:
            raise EndoscopeError('let go first')

    async def _investigate(self, order: orders.Investigate) -> Mapping[str, Any]:
        """Begin an investigation, which moves nothing before it has asked."""
        rig = await self._ask(self.graph.rig_file)
        play = self._play_asked
        if order.investigation is not None:
            one = self.investigations.resume(order.investigation, rig, order.experiments, play)
        else:
            own = await self._ask(self.graph.plant)
            one = self.investigations.begin(order.plant, own, rig, order.experiments, play)
        return {'investigation': one}

    async def _play_asked(self, motion: AskedMotion, ask: AskOperator) -> None:
        """Have a motion played under the hand of whoever consents to it."""

        def begins() -> tuple[Holder, Callable[[], str]]:
            if self._consented is not self.holder or not self._place.speaks:
                raise NotPlayedError('whoever consented has lost the controls')
            self._require_rest()
            return self._holder, self._withdrawn()

        await self.playing.motion(motion, ask, begins)

    def _halt(self) -> None:
        """End what an investigation moves."""
        self._count_halt('a person ended it')
        if self.graph.client.state == 'ENABLED':
            self.graph.client.order('pause')

    async def _set(self, order: orders.Set) -> str:
        if order.scale is not None:
            if self.beat.said.state is DeadManState.ENGAGED:
                raise EndoscopeError('the scale changes only while nothing is held')
            await self._ask(partial(self._place.set_master, scale=order.scale))
            self.graph.settings = Settings(self.graph.settings.source, order.scale)
        elif order.compensator is not None:
            await self._ask(partial(self.graph.compensate, order.compensator))
        return ''

    async def close(self) -> None:
        """End the lease and give everything back."""
        self._closing = True
        holder = self.holder
        if holder is not None:
            self.lease.release(holder.id)
            self._lease_ended(holder, 'the server of the page ends')
        await self.investigations.close()
        while self._tasks:
            await asyncio.wait(set(self._tasks))
        self.graph.client.ends.set()
        self._pool.shutdown(wait=True, cancel_futures=True)
