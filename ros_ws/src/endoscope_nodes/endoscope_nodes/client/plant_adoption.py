"""The messages ``compensator/adopt`` and ``compensator/plant``, and who asks by them."""

import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message

from endoscope_core.calibration.calibration_run import OrderState
from endoscope_core.errors import FileError
from endoscope_core.safety import AdoptionCode, BendingRange
from endoscope_nodes import names
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import PATIENCE_S, GraphError
from endoscope_nodes.runtime.diagnostics import (
    ERROR,
    OK,
    diagnostic_array,
    from_status,
    status,
    texts_of,
)
from endoscope_nodes.runtime.qos import EVENT

REQUEST = 'adopt'
IN_FORCE, ADOPTION = 'compensator: adopted plant', 'compensator: adoption'
_WITHDRAWN_S = 1.0


class RefusedAdoptionError(GraphError):
    """A plant was not put into force, or the one before not again: why, in words and as a code."""

    def __init__(self, code: AdoptionCode, words: str) -> None:
        super().__init__(words)
        self.code = code


@dataclass(frozen=True)
class AdoptionRequest:
    """What a compensator is asked to put into force."""

    id: str  # which no other request has
    # Text of the plant file; empty for the plant before. The id again, without one, withdraws it.
    plant: str
    session: str  # motion session in which it is asked for

    def message(self, stamp_ns: int) -> DiagnosticArray:
        """Write it, at a time in ns."""
        values = {'id': self.id, 'plant': self.plant}
        return diagnostic_array(stamp_ns, status(REQUEST, OK, '', values), session=self.session)

    @classmethod
    def of_message(cls, message: DiagnosticArray) -> 'AdoptionRequest | None':
        """Read it; None where it is none."""
        for part in message.status:
            values = texts_of(part)
            if part.name == REQUEST and set(values) == {'id', 'plant'}:
                return cls(**values, session=message.header.frame_id)
        return None


@dataclass(frozen=True)
class Reach:
    """How far each joint can be bent, rad."""

    bend_x: BendingRange
    bend_y: BendingRange


@dataclass(frozen=True)
class PlantInForce:
    """The adopted plant of a compensator, and what became of the last request."""

    plant: str = ''  # text of its file; empty where none has been adopted
    hash: str = ''  # of that text
    before: str = ''  # hash of the plant before, which can be put into force again
    # What stands in the file and no inverse can know, or tracks better without.
    left_out: tuple[str, ...] = ()
    reach: Reach | None = None  # None where that is not known
    words: str = ''  # the same for a person
    id: str = ''  # of the last request
    state: OrderState = OrderState.WAITING
    code: AdoptionCode = AdoptionCode.NONE
    answer: str = ''  # what became of it, in words

    @property
    def ranges(self) -> tuple[BendingRange, ...]:
        """How far each of J joints may be bent in rad; empty where that is not known."""
        return () if self.reach is None else (self.reach.bend_x, self.reach.bend_y)

    def message(self, stamp_ns: int, session: str) -> DiagnosticArray:
        """Write it, at a time in ns, of a motion session."""
        own, asked = (
            {key: getattr(self, key) for key in keys}
            for keys in (('hash', 'before', 'left_out', 'reach', 'plant'), ('id', 'state', 'code'))
        )
        level = ERROR if self.state == OrderState.REJECTED else OK
        return diagnostic_array(
            stamp_ns,
            status(IN_FORCE, OK, self.words, own),
            status(ADOPTION, level, self.answer, asked),
            session=session,
        )

    @classmethod
    def of_message(cls, message: DiagnosticArray) -> 'PlantInForce | None':
        """Read it; None where it is none."""
        part = {each.name: each for each in message.status}
        try:
            own, asked = part[IN_FORCE], part[ADOPTION]
            return from_status(cls, own, asked, words=own.message, answer=asked.message)
        except (KeyError, ValueError):
            return None


def plant_text(file: Path) -> str:
    """Text of a plant file; FileError where it cannot be read or is empty."""
    try:
        text = file.read_text(encoding='utf-8-sig')
    except OSError as error:
        raise FileError(f'cannot read {file}: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise FileError(f'{file} is not a plant file: {error.reason}') from error
    if not text.strip():
        raise FileError(f'plant file {file} is empty: give a plant.yaml')
    return text


class AdoptedPlants:
    """Hears which plant is in force, and asks for another as the one sender until he leaves."""

    def __init__(self, client: GraphClient) -> None:
        self._client = client
        self.in_force: PlantInForce | None = None  # as last reported; None before
        self._asked = ''
        self._publisher: Publisher | None = None
        self._asking = threading.Lock()
        self._answer: PlantInForce | None = None
        client.listen(DiagnosticArray, names.COMPENSATOR_PLANT, self._take, latched=True)

    def _take(self, data: bytes, _: int) -> None:
        reported = PlantInForce.of_message(deserialize_message(data, DiagnosticArray))
        if reported is None:
            return
        self.in_force = reported
        if reported.id == self._asked:
            self._answer = reported

    @property
    def _final(self) -> PlantInForce | None:
        answer = self._answer
        return None if answer is None or answer.state == OrderState.EXECUTING else answer

    def adopt(self, plant: str, patience_s: float = PATIENCE_S) -> PlantInForce:
        """Have a plant file's text put into force; empty: the plant before.

        RefusedAdoptionError if it is refused or took too long; GraphError if nobody answers.
        """
        client = self._client
        if client.state == 'FAULT':
            client.wait_until(lambda: bool(client.why), patience_s)
            raise RefusedAdoptionError(
                AdoptionCode.FAULT, f'the slave is in FAULT: {client.why or "no cause"}'
            )
        with self._asking:
            answer = self._answer_to(plant, patience_s)
        if answer.state != OrderState.SUCCEEDED:
            raise RefusedAdoptionError(answer.code, answer.answer)
        return answer

    def _answer_to(self, plant: str, patience_s: float) -> PlantInForce:
        client = self._client
        if self._publisher is None:
            self._publisher = client.node.create_publisher(
                DiagnosticArray, names.COMPENSATOR_ADOPT, EVENT
            )
        publisher = self._publisher
        found = client.wait_until(
            lambda: bool(self.in_force and publisher.get_subscription_count() and client.graph_ns),
            patience_s,
        )
        if not found:
            raise GraphError(f'no compensator takes plants in {client.where}')
        request = AdoptionRequest(f'{time.time_ns()}', plant, client.session)
        self._answer, self._asked = None, request.id
        publisher.publish(request.message(client.graph_ns))
        if not client.wait_until(lambda: self._final is not None, patience_s):
            publisher.publish(replace(request, plant='').message(client.graph_ns))
            # It may be in force just now.
            client.wait_until(lambda: self._final is not None, _WITHDRAWN_S)
        answer = self._final
        if answer is None:
            raise GraphError(
                f'the compensator has not answered for {patience_s:g} s{client.pace}, nor to that '
                'it is asked no more: the plant may still come into force; see compensator in '
                '`endoscope operate status`'
            )
        return answer

    def leave(self) -> None:
        """Leave the place of the one sender to others, once what was asked has been answered."""
        with self._asking:
            if self._publisher is not None:
                self._client.node.destroy_publisher(self._publisher)
                self._publisher = None
