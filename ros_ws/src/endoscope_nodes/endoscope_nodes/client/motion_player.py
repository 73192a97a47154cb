"""Plays a motion on a running graph, with the operator's consent, and records it."""

import math
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Protocol

from endoscope_core.errors import NotPlayedError, OutputError, RigStoppedError
from endoscope_nodes import names
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import MASTER, RECORDER, GraphError
from endoscope_nodes.client.graph_parameters import read_parameter, set_parameters

RECORDER_NODE = 'recorder'
PATIENCE_S = 20.0
NEXT_WORD_S = 1.5
"""The console says once a second how far it is; a word from before means nothing."""
REST_S = 0.5
"""After a motion, so that what it leaves behind is recorded."""
AS_COMMANDED = (('compensator', {'mode': 'none'}), ('controller', {'active': False}))
"""The motors do what the motion asks: the plant's answer to that was found to be safe."""

Consent = Callable[[str], bool]
"""Asks a person, in words, whether something may be done."""


class PlayedMotion(Protocol):
    """A motion as its player knows it."""

    @property
    def words(self) -> str:
        """As a person is asked for it."""
        ...

    @property
    def duration(self) -> float:
        """In s."""
        ...


class MotionPlayer:
    """Plays motions one at a time, each in a motion session of its own.

    A session is opened for a motion that somebody consents to, and ends with it. Whatever ends a
    motion before its end pauses the graph. With `hold_to_play` a person enables the slave, and the
    motion goes on only while the clutch is held. What is `withdrawn` after consent is not played.
    """

    def __init__(
        self,
        client: GraphClient,
        consent: Consent,
        *,
        hold_to_play: bool = False,
        withdrawn: Callable[[], bool] = lambda: False,
    ) -> None:
        self._client = client
        self._consent = consent
        self._hold_to_play = hold_to_play
        self._withdrawn = withdrawn
        self.prepares = False  # between consent and the moment in which a person may enable

    def play(self, motion: PlayedMotion, file: Path, bag: Path) -> None:
        """Play a motion, which a file holds, and record it to a bag that does not exist.

        RigStoppedError if the rig stops on the way, NotPlayedError if nobody consents or a person
        ends it, GraphError if the graph does not do what it is asked for.
        """
        client = self._client
        self._look()
        if not self._consent(f'Play this motion: {motion.words}?'):
            raise NotPlayedError('the motion was not wanted')
        self.prepares = True
        self._look()
        with ExitStack() as after:
            if client.state == 'ENABLED':
                # In a session that goes on, the master would come as a second sender.
                client.ask('disable', PATIENCE_S)
            self._as_commanded(after)
            self.prepares = False
            try:
                if self._hold_to_play:
                    # Nobody knows how long that takes: it is no part of the recording.
                    self._until_enabled()
                self._recording(bag, after)
                if not self._hold_to_play:
                    client.ask_and_see('enable', PATIENCE_S)
                self._require_enabled()
                self._played(motion, file)
            except BaseException:
                if client.state == 'ENABLED':
                    client.order('pause')
                    client.wait_until(lambda: client.state != 'ENABLED', PATIENCE_S)
                raise
            client.ask('disable', PATIENCE_S)
        if not bag.exists():
            raise OutputError(
                f'{bag} is not here: the recorder writes on another machine; run this command there'
            )

    def _look(self) -> None:
        """Hear how the graph is now: nobody has listened while something was explained."""
        client = self._client
        client.find(PATIENCE_S)
        client.wait_until(lambda: False, NEXT_WORD_S)
        if client.state == 'FAULT':
            raise RigStoppedError(f'FAULT: {client.why or "its cause is not known"}')

    def _as_commanded(self, after: ExitStack) -> None:
        """Let nothing add to the motion, until `after`."""
        silent = {'source': 'none', 'hold_to_play': self._hold_to_play, 'command_file': ''}
        for node, values in (*AS_COMMANDED, (names.MASTER_NODE, silent)):
            before = {
                name: read_parameter(self._client, f'{node}.{name}', PATIENCE_S).value
                for name in values
            }
            # Nothing begins to move by itself once the session is over.
            if node == names.MASTER_NODE and before['source'] in ('motion', 'file'):
                before['source'] = 'none'
            after.callback(set_parameters, self._client, node, before)
            given: dict[str, Any] = {k: v for k, v in values.items() if v != ''}
            set_parameters(self._client, node, given)

    def _until_enabled(self) -> None:
        client = self._client
        client.wait_until(
            lambda: client.state in ('ENABLED', 'FAULT') or self._withdrawn(), math.inf
        )
        self._require_enabled()

    def _recording(self, bag: Path, after: ExitStack) -> None:
        """Record to a bag, until `after`."""
        client = self._client
        client.wait_until(lambda: RECORDER in client.health, PATIENCE_S)
        said = client.health.get(RECORDER)
        if said is not None and said.message == 'recording automatically':
            client.trigger(names.RECORDER_STOP, PATIENCE_S)
        before = read_parameter(client, f'{RECORDER_NODE}.bag', PATIENCE_S).value
        after.callback(set_parameters, client, RECORDER_NODE, {'bag': before})
        set_parameters(client, RECORDER_NODE, {'bag': str(bag.absolute())})
        client.trigger(names.RECORDER_START, PATIENCE_S)
        after.callback(client.trigger, names.RECORDER_STOP, PATIENCE_S)

    def _played(self, motion: PlayedMotion, file: Path) -> None:
        client = self._client
        path = str(file.absolute())
        set_parameters(client, names.MASTER_NODE, {'command_file': path, 'source': 'file'})
        asked_ns = client.graph_ns

        def is_at_its_end() -> bool:
            said = client.health.get(MASTER)
            heard = said is not None and said.values[names.FINISHED] == 'True'
            return heard and client.graph_ns > asked_ns + round(NEXT_WORD_S * 1e9)

        patience_s = math.inf if self._hold_to_play else motion.duration + PATIENCE_S
        client.wait_until(
            lambda: client.state != 'ENABLED' or is_at_its_end() or self._withdrawn(), patience_s
        )
        self._require_enabled()
        if not is_at_its_end():
            raise GraphError(f'the console did not play {file} to its end in {patience_s:.0f} s')
        client.wait_until(lambda: client.state != 'ENABLED', REST_S)
        self._require_enabled()
        set_parameters(client, names.MASTER_NODE, {'source': 'none'})

    def _require_enabled(self) -> None:
        client = self._client
        if client.state == 'FAULT':
            client.wait_until(lambda: bool(client.why), NEXT_WORD_S)
            raise RigStoppedError(f'FAULT: {client.why or "its cause is not known"}')
        if self._withdrawn():
            raise NotPlayedError('a person ended it')
        if client.state != 'ENABLED':
            raise NotPlayedError(f'the slave is {client.state}: {client.why or "asked for"}')
