"""Control of the slave: the lease, the publisher of the handle topics, and what ends with them."""

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from endoscope_console.beat import Beat, Situation
from endoscope_console.clients import Attendance, Client, Clients, Lease
from endoscope_console.graph_side import GraphSide
from endoscope_console.playing import HandlePlace, Holder, Playing
from endoscope_console.teleop.frames import InputFrame
from endoscope_console.teleop.operator import DeadManState, Reason
from endoscope_core.choices import FOLLOW_THE_HANDLE
from endoscope_core.errors import EndoscopeError

_WAITING_ORDERS = 16


@dataclass
class Controls:
    """Lends the controls to one operator at a time; lives in the thread of the sockets."""

    graph: GraphSide
    beat: Beat
    clients: Clients
    counts: Counter[str]  # of refusals
    lease: Lease = field(default_factory=Lease)  # of the one operator
    attendance: Attendance = field(default_factory=Attendance)  # of the session that is open

    def __post_init__(self) -> None:
        self._pool = ThreadPoolExecutor(_WAITING_ORDERS, thread_name_prefix='order')
        self.place = HandlePlace(self.graph, self.beat, self.ask)
        self.playing = Playing(self.graph, self.place, self.ask, self.soon)
        self.holder = Holder()
        self._halts = 0
        self._why_halted = ''
        self._closing = False
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def operator(self) -> Client | None:
        return self.holder.client if self.lease.holder else None

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
        """End a silent lease, and update the beat's situation; at a steady time in ns."""
        silent = self.lease.turn(now_ns)
        if silent and self.holder.client is not None:
            why = 'its page was silent for 2 s'
            self.holder.client.notify({'op': 'lost', 'by': '', 'why': why})
            self._lease_ended(self.holder.client, why)
        if self.holder.moves and not self.holder.waits and self.graph.client.underway is None:
            self.holder.moves = ''
        if self.playing.is_over():
            self.soon(self.playing.end(self.holder))
        client = self.graph.client
        session = client.session if client.state == 'ENABLED' else ''
        if self.attendance.turn(now_ns, session, not session or self._is_attended()):
            client.order('pause')
            self.graph.log('pause', '', '', True, 'nobody operates')
        self._update_beat()

    def _is_attended(self) -> bool:
        """Whether anybody operates, here or by another program."""
        if self.lease.holder:
            return True
        other = self.graph.settings.source not in ('', FOLLOW_THE_HANDLE)
        return not self.place.publishes and (other or bool(self.graph.others_at_the_handle()))

    def _update_beat(self) -> None:
        graph, pictures = self.graph, self.graph.pictures
        self.beat.situation = Situation(
            holder=self.lease.holder,
            publishes=self.place.publishes and bool(self.lease.holder),
            state_enabled=graph.client.state == 'ENABLED' and graph.ended is None,
            state_ns=graph.heard_ns,
            calibrating=graph.client.underway is not None,
            source=graph.settings.source if self.place.publishes else '',
            pictures=pictures.made,
            playing=self.playing.underway,
            session=graph.client.session,
            wanted=pictures.wanted,
            wanted_ns=pictures.wanted_ns,
            scale=graph.settings.scale,
        )

    async def ask[T](self, ask: Callable[[], T]) -> T:
        """Wait for the graph in a thread of the pool: the sockets go on meanwhile."""
        return await asyncio.get_running_loop().run_in_executor(self._pool, ask)

    async def claim(self, client: Client, take: bool) -> str:
        """Make a client the operator; returns the answer."""
        if self._closing:
            raise EndoscopeError('the server of the page ends')
        if self.holds(client) and self.place.publishes:
            return ''
        claim = self.lease.claim(client.id, take, time.monotonic_ns())
        if not claim.granted:
            raise EndoscopeError(claim.why)
        if claim.lost_by:
            self._lost(claim.lost_by, client)
        if self.holder.client is not client:
            self.holder = Holder(client)
        self._update_beat()
        async with self.place.lock:
            try:
                if not self.place.publishes:
                    await self.place.take(take)
            except BaseException:
                if self.lease.holder == client.id:
                    self.lease.release(client.id)
                    self.holder = Holder()
                    self._update_beat()
                raise
            if self.lease.holder != client.id:
                self.soon(self._give_back())
                raise EndoscopeError('the controls were lost meanwhile')
            self._update_beat()
        return ''

    def _lost(self, holder: str, to: Client) -> None:
        """Notify an operator that another took the lease."""
        self._end_what_moves(holder, 'another took the controls')
        lost = self.clients.by_id(holder)
        if lost is not None:
            lost.notify({'op': 'lost', 'by': to.label, 'why': f'{to.label} took the controls'})
            self.graph.log('lease', lost.id, lost.address, True, f'taken by {to.label}')

    def release(self, client: Client) -> str:
        if client.id == self.lease.holder:
            self.lease.release(client.id)
            self._lease_ended(client, 'given back')
        return ''

    def _lease_ended(self, client: Client, why: str) -> None:
        self._end_what_moves(client.id, f'its operator lost the controls: {why}')
        self.holder = Holder()
        self._update_beat()
        self.graph.log('lease', client.id, client.address, True, f'ended: {why}')
        self.soon(self._give_back())

    def _end_what_moves(self, holder: str, why: str) -> None:
        """End every motion that an operator has started or requested."""
        self.count_halt(why)
        # He may hold the lease again before the next beat looks.
        self.beat.refuse(holder, Reason.LOST, time.monotonic_ns())
        if self.holder.moves:
            self.graph.client.order('pause')
        if self.playing.is_experiment:
            # The next operator's grip must not continue what this one had played.
            self.soon(self.playing.end(self.holder))

    def soon(self, work: Coroutine[Any, Any, None]) -> None:
        """Run something concurrently; :meth:`close` waits for its end."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _give_back(self) -> None:
        """Leave the handle to others, unless somebody has taken the controls meanwhile."""
        async with self.place.lock:
            if self.lease.holder or not self.place.publishes:
                return
            self.place.publishes = False
            self._update_beat()
            await self.ask(self.graph.plants.leave)
            await self.place.give_back()

    def count_halt(self, why: str) -> None:
        self._halts, self._why_halted = self._halts + 1, why

    def withdrawn(self) -> Callable[[], str]:
        """What has ended motion since now, in words; empty for nothing."""
        halts = self._halts
        return lambda: '' if self._halts == halts else self._why_halted

    async def moving(self, what: str, move: Callable[[], str]) -> str:
        """Have the slave moved, for as long as the client operates."""
        holder = self.holder
        if holder.moves:
            raise EndoscopeError(f'{holder.moves} is under way')
        if self.beat.report.state is DeadManState.ENGAGED:
            raise EndoscopeError('let go first: it moves the slave by itself')
        holder.moves, holder.waits = what, True
        try:
            answer = await self.ask(move)
            holder.moves = ''
        finally:
            # A wait that timed out has not ended it.
            holder.waits = False
        return answer

    def holds(self, client: Client) -> bool:
        return self.lease.holder == client.id

    def require_rest(self) -> None:
        if self.holder.moves:
            raise EndoscopeError(f'{self.holder.moves} is under way')
        if self.beat.report.state is DeadManState.ENGAGED:
            raise EndoscopeError('let go first')

    def relieve(self) -> None:
        """End the lease, and lend to nobody any more."""
        self._closing = True
        operator = self.operator
        if operator is not None:
            self.lease.release(operator.id)
            self._lease_ended(operator, 'the server of the page ends')

    async def close(self) -> None:
        """Wait for the end of all that was begun."""
        while self._tasks:
            await asyncio.wait(set(self._tasks))
        self.graph.client.ends.set()
        self._pool.shutdown(wait=True, cancel_futures=True)
