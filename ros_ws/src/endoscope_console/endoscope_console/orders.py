"""Orders of an operator's page, in JSON: one struct per order; anything else is rejected."""

from typing import Annotated, Literal

import msgspec

from endoscope_core.choices import MODES
from endoscope_core.errors import EndoscopeError

LARGEST_BYTES = 4096
"""Of any frame that a client sends."""
HALTS = ('pause', 'disable')
"""Commands that end motion: they wait for nothing."""

_Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
_Number = Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class MalformedOrderError(EndoscopeError, ValueError):
    """Text that is no order; the message says what is wrong with it."""


class Hello(msgspec.Struct, frozen=True, tag='hello', tag_field='op', forbid_unknown_fields=True):
    """The first message on a socket."""

    token: Annotated[str, msgspec.Meta(max_length=200)]


class _Order(msgspec.Struct, frozen=True, tag_field='op', forbid_unknown_fields=True):
    id: _Number


class Claim(_Order, tag='claim', frozen=True):
    """Become the operator; `take` from whoever is, and end what the master plays."""

    take: bool = False


class Release(_Order, tag='release', frozen=True):
    """Give the controls back."""


class StateOrder(_Order, tag='state', frozen=True):
    """Ask the supervisor for another operating state, or for the way home."""

    command: Literal['enable', 'disable', 'pause', 'resume', 'home']


class Calibrate(_Order, tag='calibrate', frozen=True):
    """Find the class of the tube, which moves the slave."""


class Set(_Order, tag='set', frozen=True):
    """Set one thing: `scale` of the motion, or `compensator` mode."""

    scale: Annotated[float, msgspec.Meta(ge=0.01, le=10.0)] | None = None
    compensator: Literal[MODES] | None = None  # type: ignore[valid-type]

    def __post_init__(self) -> None:
        if (self.scale is None) == (self.compensator is None):
            raise ValueError('set one of scale and compensator')


class Record(_Order, tag='record', frozen=True):
    """Begin a recording, or end it."""

    on: bool


class Mark(_Order, tag='mark', frozen=True):
    """Save an event: the recorder's preceding and following seconds, with a reason."""

    reason: Annotated[str, msgspec.Meta(max_length=1000)] = ''


class Acknowledge(_Order, tag='acknowledge', frozen=True):
    """Take note of an alarm whose cause has gone."""

    alarm: _Name


class Bags(_Order, tag='bags', frozen=True):
    """List the recordings and plants that there are."""


class Explain(_Order, tag='explain', frozen=True):
    """Explain a recording by a plant; names are those that `bags` lists."""

    bag: _Name
    plant: _Name | None = None
    baseline: _Name | None = None
    validate: _Name | None = None


class Cancel(_Order, tag='cancel', frozen=True):
    """End an explanation that is under way."""

    explanation: _Name


class PlayExperiment(_Order, tag='play', frozen=True):
    """Play the next experiment of an explanation."""

    explanation: _Name


class Adopt(_Order, tag='adopt', frozen=True):
    """Put a plant that `bags` lists into force, or without one the plant before."""

    plant: _Name | None = None


class Investigate(_Order, tag='investigate', frozen=True):
    """Investigate the rig by a plant, or continue an investigation that was interrupted."""

    experiments: Annotated[int, msgspec.Meta(ge=0, le=100)]
    plant: _Name | None = None
    investigation: _Name | None = None


class Consent(_Order, tag='consent', frozen=True):
    """Answer whether a motion that an investigation asks for may be made."""

    question: _Name
    go: bool


class StopInvestigation(_Order, tag='stop', frozen=True):
    """End an investigation, and pause what it moves."""

    investigation: _Name


Order = (
    Claim
    | Release
    | StateOrder
    | Calibrate
    | Set
    | Record
    | Mark
    | Acknowledge
    | Bags
    | Explain
    | Cancel
    | PlayExperiment
    | Adopt
    | Investigate
    | Consent
    | StopInvestigation
)
"""Any of them."""

_orders = msgspec.json.Decoder(Order)
_hello = msgspec.json.Decoder(Hello)


def read_order(text: str) -> Order:
    """Read an order."""
    return _read(_orders, text)


def read_hello(text: str) -> Hello:
    """Read the first words of a client."""
    return _read(_hello, text)


def _read[T](decoder: msgspec.json.Decoder[T], text: str) -> T:
    try:
        return decoder.decode(text)
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        raise MalformedOrderError(f'no order: {error}') from error


def in_words(order: Order) -> str:
    """Name an order with what it asks for: ``state enable``, ``set scale 0.5``."""
    fields = msgspec.structs.asdict(order)
    words = [order.__struct_config__.tag]
    for name, value in fields.items():
        if name == 'id' or value is None or value is False:
            continue
        words += [name] if value is True else [name, str(value)]
    return ' '.join(str(word) for word in words)
