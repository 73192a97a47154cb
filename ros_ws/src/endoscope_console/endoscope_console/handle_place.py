"""The handle topics, which have one publisher at a time, and the master that follows them."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, Protocol

from endoscope_console.beat import Beat
from endoscope_console.graph_side import ANSWER_S, GraphSide, Settings
from endoscope_core.choices import FOLLOW_THE_HANDLE, PLAYS
from endoscope_core.errors import EndoscopeError
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.client.graph_parameters import read_parameter, set_parameters
from endoscope_nodes.names import MASTER_NODE

_PLACE_S = 5.0
_LOOK_S = 0.05
# Until all nodes know that a sender of the handle has gone.
_SETTLED_S = 0.2
_SILENCED_S = 2.0


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
        settings = graph.settings = await self._ask(self._read_settings)
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

    def _read_settings(self) -> Settings:
        return Settings(**self.read_master('source', 'scale'))

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
