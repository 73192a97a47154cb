"""Whether a rig is real, made of emulated devices or simulated: what a recording says of itself."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from hashlib import sha256
from typing import Any

import yaml

from endoscope_core.errors import FileError
from endoscope_core.schema import parse_yaml


class Kind(StrEnum):
    """Kind of a rig, by what its motors are; the first of several in a recording holds for it."""

    SIMULATED = 'simulated'  # the plant of this project moves
    EMULATED = 'emulated'  # servos that this project emulates answer the driver
    UNKNOWN = 'unknown'  # nobody said
    REAL = 'real'


@dataclass(frozen=True)
class RigKind:
    """What kind a rig is, and by what it can be known again; empty where nobody said it."""

    kind: Kind = Kind.UNKNOWN
    program: str = ''  # name and version of the program that drove or simulated it
    rig_sha256: str = ''  # of the facts of its rig.yaml, as `rig_as_text` writes them
    plant: str = ''  # file name of the plant that was simulated, or `nominal`
    plant_sha256: str = ''  # of that plant, as `save_plant` writes it

    def as_text(self) -> str:
        """Return it as YAML, as it stands on the topic; what is empty is left out."""
        said = {name: str(value) for name, value in asdict(self).items() if value}
        return yaml.safe_dump(said, sort_keys=False)

    def as_json(self) -> dict[str, str]:
        """Return it as plain data."""
        return {name: str(value) for name, value in asdict(self).items()}

    def __str__(self) -> str:
        known = [
            self.program,
            f'rig {self.rig_sha256[:12]}' if self.rig_sha256 else '',
            ' '.join(['plant', *filter(None, (self.plant, self.plant_sha256[:12]))])
            if self.plant_sha256
            else '',
        ]
        told = ', '.join(filter(None, known))
        return f'{self.kind} ({told})' if told else str(self.kind)


def digest(text: str) -> str:
    """SHA-256 of a rig or a plant as text, in hexadecimal digits."""
    return sha256(text.encode()).hexdigest()


def kind_from_text(text: str) -> RigKind:
    """Read what `RigKind.as_text` wrote; whatever else a recording has there is unknown."""
    try:
        said = parse_yaml(text, 'kind of the rig')
    except FileError:
        # A recording of somebody else's: that its topic says something else makes it no real one.
        return RigKind()
    if not isinstance(said, Mapping) or said.get('kind') not in list(Kind):
        return RigKind()
    words: dict[str, Any] = {
        name: str(said.get(name, '')) for name in RigKind.__dataclass_fields__ if name != 'kind'
    }
    return RigKind(Kind(said['kind']), **words)


def kind_of_several(said: list[RigKind]) -> RigKind:
    """Return the kind of a recording in which `said` was said: real only where all of it is."""
    return min(said, key=lambda one: list(Kind).index(one.kind), default=RigKind())
