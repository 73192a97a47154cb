"""Plays a motion on a running graph, with the operator's consent, and records it."""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

from sensor_msgs.msg import Joy
from std_srvs.srv import Trigger

from endoscope_core.errors import NotPlayedError, OutputError, RigStoppedError
from endoscope_core.investigation_folder import is_left_behind
from endoscope_nodes import names
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import MASTER, PATIENCE_S, RECORDER, GraphError
from endoscope_nodes.client.graph_parameters import read_parameter, set_parameters
from endoscope_nodes.client.handle_sender import clutch_message
from endoscope_nodes.client.plant_adoption import AdoptedPlants, RefusedAdoptionError, plant_text
from endoscope_nodes.runtime.node_parameters import FOR_SESSION
from endoscope_nodes.runtime.qos import EVENT

RECORDER_NODE = 'recorder'
NEXT_WORD_S = 1.5
"""The master says once a second how far it is; a word from before means nothing."""
LET_GO_S = 0.2
"""Before the clutch is held, in several words, so that each node has heard one."""
REST_S = 0.5
"""After a motion, so that what it leaves behind is recorded."""
AS_COMMANDED: tuple[tuple[str, dict[str, Any]], ...] = (
    ('compensator', {'mode': 'none'}),
    ('controller', {'active': False}),
)
"""The motors do what the motion asks: the plant's answer to that was found to be safe."""

Consent = Callable[[str], bool]
"""Asks a person, in words, whether something may be done."""


class MotionToPlay(Protocol):
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
    """Plays motions, each with consent in a motion session of its own, which ends with it.

    Whatever ends a motion before its end pauses the graph. The player holds the clutch, so that
    nothing moves on once its program is gone, or with `hold_to_play` a person, who enables the
    slave, too. What is `withdrawn` after consent, for a reason in words, is not played. A recording
    that nobody asked for or needs any more makes room for its own; any other goes on.
    """

    def __init__(
        self,
        client: GraphClient,
        consent: Consent,
        *,
        hold_to_play: bool = False,
        withdrawn: Callable[[], str] = lambda: '',
        plants: AdoptedPlants | None = None,
    ) -> None:
        self._client = client
        self._consent = consent
        self._hold_to_play = hold_to_play
        self._withdrawn = withdrawn
        self._plants = plants or AdoptedPlants(client)
        self.prepares = False  # once consented to, whether it may not be enabled yet

    def play(self, motion: MotionToPlay, file: Path, bag: Path, plant: Path | None = None) -> None:
        """Play a file's motion, by the inverse of a plant file if any, and record it to a new bag.

        RigStoppedError if the rig stops on the way, NotPlayedError without consent, if a person
        ends it or the plant is refused, GraphError if the graph does not do what it is asked for.
        """
        client = self._client
        self._look()
        # From before the consent on: there is no moment after it in which one may enable.
        self.prepares = True
        if not self._consent(f'Play this motion: {motion.words}?'):
            raise NotPlayedError('the motion was not wanted')
        self._look()
        with ExitStack() as after:
            if client.state != 'DISABLED':
                # In a session that goes on, the master would come as a second sender.
                client.ask('disable', PATIENCE_S)
            self._silence_master(after)
            self.prepares = False
            try:
                if self._hold_to_play:
                    # Nobody knows how long that takes: it is no part of the recording.
                    self._until_enabled()
                self._recording(bag, after)
                if not self._hold_to_play:
                    client.ask_and_see('enable', PATIENCE_S)
                self._require_enabled()
                for node, values in AS_COMMANDED:
                    self._set_for_session(node, values, after)
                if plant is not None:
                    self._through(plant_text(plant), lambda: self._played(motion, file))
                else:
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

    def _silence_master(self, after: ExitStack) -> None:
        """Let nobody else move the slave in the session that is going to be opened."""
        source = f'{names.MASTER_NODE}.source'
        if read_parameter(self._client, source, PATIENCE_S).value in ('motion', 'file'):
            # Nothing begins to move by itself once the session is over.
            set_parameters(self._client, names.MASTER_NODE, {'source': 'none'})
        self._set_for_session(names.MASTER_NODE, {'source': 'none', 'hold_to_play': True}, after)

    def _set_for_session(self, node: str, values: dict[str, Any], after: ExitStack) -> None:
        """Set parameters until the motion session ends, `after` at the latest."""
        after.callback(set_parameters, self._client, node, {FOR_SESSION: False})
        set_parameters(self._client, node, values | {FOR_SESSION: True})

    def _through(self, plant: str, played: Callable[[], None]) -> None:
        """Do something while the compensator inverts a plant."""
        plants = self._plants
        try:
            self._session()
            plants.adopt(plant, PATIENCE_S)
            played()
        except RefusedAdoptionError as error:
            raise NotPlayedError(f'the compensator does not take the plant: {error}') from error
        finally:
            plants.leave()

    def _until_enabled(self) -> None:
        client = self._client
        client.wait_until(
            lambda: client.state in ('ENABLED', 'FAULT') or bool(self._withdrawn()), math.inf
        )
        self._require_enabled()

    def _recording(self, bag: Path, after: ExitStack) -> None:
        """Record to a bag, until `after`."""
        client = self._client
        client.wait_until(lambda: RECORDER in client.health, PATIENCE_S)
        latest = client.health.get(RECORDER)
        before = read_parameter(client, f'{RECORDER_NODE}.bag', PATIENCE_S).value
        written = None if latest is None else latest.values.get(names.BAG)
        if written is not None and is_left_behind(Path(written), bag.parent):
            # The next recording would have the name of this one.
            before = ''
            # Whether it is whole is nothing that this motion depends on.
            client.call(Trigger, names.RECORDER_STOP, Trigger.Request(), PATIENCE_S)
        after.callback(set_parameters, client, RECORDER_NODE, {'bag': before})
        set_parameters(client, RECORDER_NODE, {'bag': str(bag.absolute())})
        client.trigger(names.RECORDER_START, PATIENCE_S)
        after.callback(client.trigger, names.RECORDER_STOP, PATIENCE_S)

    @contextmanager
    def _clutch(self) -> Iterator[Callable[[], None]]:
        """What holds the clutch a little longer, unless a person does."""
        if self._hold_to_play:
            yield lambda: None
            return
        client = self._client
        publisher = client.node.create_publisher(Joy, names.MASTER_CLUTCH, EVENT)

        def let_go() -> bool:
            publisher.publish(clutch_message(False, client.graph_ns))
            return False

        try:
            client.wait_until(lambda: publisher.get_subscription_count() > 0, PATIENCE_S)
            # Where two have held it, nodes take the clutch as released until it is.
            client.wait_until(let_go, LET_GO_S)
            yield lambda: publisher.publish(clutch_message(True, client.graph_ns))
        finally:
            publisher.publish(clutch_message(False, client.graph_ns))
            client.node.destroy_publisher(publisher)

    def _played(self, motion: MotionToPlay, file: Path) -> None:
        client = self._client
        session = self._session()
        path = str(file.absolute())
        playing = {'command_file': path, 'source': 'file', FOR_SESSION: True}
        set_parameters(client, names.MASTER_NODE, playing)
        asked_ns = client.graph_ns

        def is_at_its_end() -> bool:
            latest = client.health.get(MASTER)
            heard = latest is not None and latest.values[names.FINISHED] == 'True'
            return heard and client.graph_ns > asked_ns + round(NEXT_WORD_S * 1e9)

        patience_s = math.inf if self._hold_to_play else motion.duration + PATIENCE_S
        with self._clutch() as hold:

            def has_ended() -> bool:
                hold()
                return not self._goes_on(session) or is_at_its_end()

            client.wait_until(has_ended, patience_s)
            self._require_enabled(session)
            if not is_at_its_end():
                raise GraphError(
                    f'the master did not play {file} to its end in {patience_s:.0f} s{client.pace}'
                )
        client.wait_until(lambda: not self._goes_on(session), REST_S)
        self._require_enabled(session)

    def _session(self) -> str:
        """The motion session that has been opened, which is published a beat after the state."""
        client = self._client
        client.wait_until(lambda: bool(client.session) or client.state != 'ENABLED', PATIENCE_S)
        return client.session

    def _goes_on(self, session: str) -> bool:
        client = self._client
        return client.state == 'ENABLED' and client.session == session and not self._withdrawn()

    def _require_enabled(self, session: str | None = None) -> None:
        client = self._client
        if client.state == 'FAULT':
            client.wait_until(lambda: bool(client.why), NEXT_WORD_S)
            raise RigStoppedError(f'FAULT: {client.why or "its cause is not known"}')
        withdrawn = self._withdrawn()
        if withdrawn:
            raise NotPlayedError(withdrawn)
        if client.state != 'ENABLED':
            raise NotPlayedError(f'the slave is {client.state}: {client.why or "asked for"}')
        if session is not None and client.session != session:
            raise NotPlayedError('somebody else has opened another motion session')
