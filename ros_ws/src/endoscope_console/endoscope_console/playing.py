"""What the master follows: the handle, whose topics have one publisher at a time, or a motion.

Motions, of an experiment or an investigation, play while the dead-man is held.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from endoscope_console.beat import Beat
from endoscope_console.clients import Client
from endoscope_console.graph_side import ANSWER_S, GraphSide, Settings
from endoscope_console.investigations import AskedMotion, Consent
from endoscope_core.choices import FOLLOW_THE_HANDLE, PLAYS
from endoscope_core.errors import EndoscopeError
from endoscope_nodes.client.graph_listener import MASTER, GraphError
from endoscope_nodes.client.graph_parameters import read_parameter, set_parameters
from endoscope_nodes.client.motion_player import MotionPlayer
from endoscope_nodes.names import FINISHED, MASTER_NODE

_PLACE_S = 5.0
_LOOK_S = 0.05
# Until all nodes know that a sender of the handle has gone.
_SETTLED_S = 0.2
_SILENCED_S = 2.0
# The master reports its progress once a second; a report from before the request is ignored.
_NEXT_WORD_NS = 1_500_000_000
_EXPERIMENT = 'an experiment'
_INVESTIGATION = 'a motion of an investigation'


class Ask(Protocol):
    """Waits for the graph in another thread."""

    def __call__[T](self, ask: Callable[[], T]) -> Awaitable[T]:
        """Return what asking gives."""
        ...


class HandlePlace:
    """Lives in the thread of the sockets; `ask` waits for the graph in another."""

    def __init__(self, graph: GraphSide, beat: Beat, ask: Ask) -> None:
        self.lock = asyncio.Lock()  # of whoever changes what the master follows
        self.publishes = False  # whether this server is the publisher of the handle topics
        self._graph, self._beat, self._ask = graph, beat, ask
        self._found = FOLLOW_THE_HANDLE

    async def take(self, take: bool) -> None:
        """Become the publisher of the handle topics, and have the master follow them."""
        graph = self._graph
        found = await self._ask(partial(self.read_master, 'source', 'scale'))
        settings = graph.settings = Settings(**found)
        if graph.plays and not take:
            raise EndoscopeError(
                f'the master plays (its source is {settings.source}): taking the controls would '
                'end that'
            )
        own = (MASTER_NODE,) if settings.source in PLAYS else ()
        others = [name for name in graph.others_at_the_handle() if name not in own]
        if others:
            raise EndoscopeError(
                f'the handle topics are already published by {" and ".join(others)}; a second '
                'publisher would be a fault: end the other first'
            )
        if settings.source != FOLLOW_THE_HANDLE:
            await self._ask(partial(self.set_master, source=FOLLOW_THE_HANDLE))
            end = time.monotonic() + _PLACE_S
            while graph.others_at_the_handle() and time.monotonic() < end:
                await asyncio.sleep(_LOOK_S)
            others = graph.others_at_the_handle()
            if others:
                await self._set_source_back(settings.source)
                raise EndoscopeError(
                    f'the handle topics are still published by {" and ".join(others)}'
                )
            # A session that begins while a node still knows of the old sender ends as a fault.
            await asyncio.sleep(_SETTLED_S)
        self._found = settings.source
        graph.settings = Settings(FOLLOW_THE_HANDLE, settings.scale)
        self.publishes = True

    def read_master(self, *names: str) -> dict[str, Any]:
        """Values of the master's parameters."""
        client = self._graph.client
        return {n: read_parameter(client, f'{MASTER_NODE}.{n}', ANSWER_S).value for n in names}

    def set_master(self, **values: Any) -> None:
        """Set parameters of the master."""
        set_parameters(self._graph.client, MASTER_NODE, values, ANSWER_S)

    async def give_back(self) -> None:
        """Leave the handle to others, and the master as it was found."""
        end = time.monotonic() + _SILENCED_S
        while self._beat.report.publishes and time.monotonic() < end:
            await asyncio.sleep(_LOOK_S)
        await asyncio.sleep(_SETTLED_S)
        source, self._found = self._found, FOLLOW_THE_HANDLE
        try:
            await self._set_source_back(source)
        except GraphError as error:
            self._graph.log(f'master.source {source}', '', '', False, str(error))
        self._graph.ask_for_settings(time.monotonic_ns())

    async def _set_source_back(self, source: str) -> None:
        """Have the master follow what it did before, which begins no motion by itself."""
        if source in PLAYS and self._graph.client.state == 'ENABLED':
            await self._ask(partial(self._graph.client.ask, 'pause', ANSWER_S))
        if source != FOLLOW_THE_HANDLE:
            await self._ask(partial(self.set_master, source=source))


@dataclass
class Holder:
    """What the holder of the lease has begun, and whether its end is still waited for."""

    client: Client | None = None
    moves: str = ''
    waits: bool = False


Begins = Callable[[], tuple[Holder, Callable[[], str]]]
"""Whose motion it is that begins now, and why it has been withdrawn since, if it has."""


@dataclass
class _Played:
    """An experiment that the master plays while the operator holds on."""

    begun_ns: int
    before: Mapping[str, Any]  # what the master was set to for a file of its own
    ends: bool = False


class Playing:
    """Lives in the thread of the sockets; `ask` waits for the graph in another."""

    def __init__(
        self,
        graph: GraphSide,
        place: HandlePlace,
        ask: Ask,
        soon: Callable[[Coroutine[Any, Any, None]], None],
    ) -> None:
        self._graph, self._place, self._ask, self._soon = graph, place, ask, soon
        self._played: _Played | None = None
        self.investigates = False  # a motion that was consented to is under way
        self._player: MotionPlayer | None = None

    @property
    def underway(self) -> bool:
        """Whether the master plays something that needs the clutch held."""
        asked = self.investigates and self._graph.settings.source == 'file'
        return self._played is not None or asked

    @property
    def prepares(self) -> bool:
        """Whether a motion that was consented to is not ready to be enabled yet."""
        return self.investigates and self._player is not None and self._player.prepares

    @property
    def is_experiment(self) -> bool:
        """Whether that is an experiment."""
        return self._played is not None

    def is_over(self) -> bool:
        """Whether the master has reported the end of the experiment since it was requested."""
        played = self._played
        if played is None or played.ends:
            return False
        health = self._graph.client.health.get(MASTER)
        heard = health is not None and health.values[FINISHED] == 'True'
        played.ends = heard and time.monotonic_ns() - played.begun_ns > _NEXT_WORD_NS
        return played.ends

    async def begin(self, holder: Holder, still: Callable[[], bool], file: Path) -> str:
        """Have an experiment played for `holder`, if it is `still` his to move something."""
        values = {'command_file': str(file), 'hold_to_play': True, 'source': 'file'}
        async with self._place.lock:
            changed = 'command_file', 'hold_to_play'
            before = await self._ask(partial(self._place.read_master, *changed))
            if not still() or holder.moves:
                raise EndoscopeError('the controls were lost or taken to something else')
            # Set in advance: if the controls are lost meanwhile, this is undone as well.
            holder.moves, holder.waits = _EXPERIMENT, True
            played = self._played = _Played(time.monotonic_ns(), before)
            try:
                await self._ask(partial(self._place.set_master, **values))
            except BaseException:
                # It may have been set all the same, and only not answered.
                self._soon(self.end(holder))
                raise
            self._graph.settings = Settings('file', self._graph.settings.scale)
            played.begun_ns = time.monotonic_ns()
        return 'it plays while the dead-man is held; give the controls back to leave it'

    async def end(self, holder: Holder) -> None:
        """Have the master follow the handle again after an experiment."""
        async with self._place.lock:
            if self._played is None:
                return
            before, self._played = dict(self._played.before), None
            if holder.moves == _EXPERIMENT:
                holder.moves = ''
            try:
                before = before | {'source': FOLLOW_THE_HANDLE}
                await self._ask(partial(self._place.set_master, **before))
            except GraphError as error:
                self._graph.log(f'master.source {FOLLOW_THE_HANDLE}', '', '', False, str(error))
            self._graph.ask_for_settings(time.monotonic_ns())

    async def motion(self, motion: AskedMotion, consent: Consent, begins: Begins) -> None:
        """Have a motion that is asked for played and recorded, as a `MotionPlayer` does."""
        loop = asyncio.get_running_loop()
        begun: list[Callable[[], str]] = []
        async with AsyncExitStack() as held:

            async def consented(words: str) -> bool:
                if not await consent(words):
                    return False
                await held.enter_async_context(self._place.lock)
                holder, why_withdrawn = begins()
                begun.append(why_withdrawn)
                holder.moves, holder.waits = _INVESTIGATION, True
                self.investigates = True
                held.callback(self._has_ended, holder)
                return True

            self._player = player = MotionPlayer(
                self._graph.client,
                lambda words: asyncio.run_coroutine_threadsafe(consented(words), loop).result(),
                hold_to_play=True,
                withdrawn=lambda: next(filter(None, (why() for why in begun)), ''),
                plants=self._graph.plants,
            )
            await self._ask(partial(player.play, motion, motion.file, motion.bag, motion.plant))

    def _has_ended(self, holder: Holder) -> None:
        holder.moves, self.investigates = '', False
        self._graph.ask_for_settings(time.monotonic_ns())
