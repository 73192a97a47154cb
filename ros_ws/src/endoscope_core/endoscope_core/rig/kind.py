"""Kind of a rig, as its recordings carry it: real, of emulated devices, or simulated."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from hashlib import sha256
from typing import Any

import yaml

from endoscope_core.errors import FileError
from endoscope_core.schema import parse_yaml


class Kind(StrEnum):
    """Kind of a rig, by its motors; of several in a recording the first listed here counts."""

    SIMULATED = 'simulated'  # the plant of this project moves
    EMULATED = 'emulated'  # servos that this project emulates answer the driver
    UNKNOWN = 'unknown'  # not recorded
    REAL = 'real'


@dataclass(frozen=True)
class RigKind:
    """Kind and identification of a rig; empty where not recorded."""

    kind: Kind = Kind.UNKNOWN
    program: str = ''  # name and version of the program that drove or simulated it
    rig_sha256: str = ''  # of the facts of its rig.yaml, as `rig_as_text` writes them
    plant: str = ''  # file name of the plant that was simulated, or `nominal`
    plant_sha256: str = ''  # of that plant, as `save_plant` writes it

    def as_text(self) -> str:
        """Return it as YAML, as it stands on the topic; what is empty is left out."""
        known = {name: str(value) for name, value in asdict(self).items() if value}
        return yaml.safe_dump(known, sort_keys=False)

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
        details = ', '.join(filter(None, known))
        return f'{self.kind} ({details})' if details else str(self.kind)


def digest(text: str) -> str:
    """SHA-256 of a rig or a plant as text, in hexadecimal digits."""
    return sha256(text.encode()).hexdigest()


def kind_from_text(text: str) -> RigKind:
    """Read what `RigKind.as_text` wrote; any other text is of an unknown kind."""
    try:
        document = parse_yaml(text, 'kind of the rig')
    except FileError:
        # A foreign recording: other content of this topic does not make the rig a real one.
        return RigKind()
    if not isinstance(document, Mapping) or document.get('kind') not in list(Kind):
        return RigKind()
    words: dict[str, Any] = {
        name: str(document.get(name, '')) for name in RigKind.__dataclass_fields__ if name != 'kind'
    }
    return RigKind(Kind(document['kind']), **words)


def kind_of_several(kinds: list[RigKind]) -> RigKind:
    """Return the kind of a recording that carries several: real only if all of them are."""
    return min(kinds, key=lambda one: list(Kind).index(one.kind), default=RigKind())
