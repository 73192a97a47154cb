"""Motions that the master plays while the dead-man is held: experiments and requested motions."""

import asyncio
import time
from collections.abc import Callable, Coroutine, Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from endoscope_console.clients import Client
from endoscope_console.graph_side import GraphSide, Settings
from endoscope_console.handle_place import Ask, HandlePlace
from endoscope_console.investigations import AskedMotion, Consent
from endoscope_core.choices import FOLLOW_THE_HANDLE
from endoscope_core.errors import EndoscopeError
from endoscope_nodes.client.graph_listener import MASTER, GraphError
from endoscope_nodes.client.motion_player import MotionPlayer
from endoscope_nodes.names import FINISHED

# The master reports its progress once a second; a report from before the request is ignored.
_NEXT_WORD_NS = 1_500_000_000
_EXPERIMENT = 'an experiment'
_INVESTIGATION = 'a motion of an investigation'


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
