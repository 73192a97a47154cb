"""What came out of one concealed case, beside what was concealed."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Named:
    """One effect that was reported.

    Attributes
    ----------
    id, joint, stage : str
    probability : float
    alternatives : tuple of str
    parameters : mapping of str to (float, float, float)
        Value, low, high.
    """

    id: str
    joint: str
    stage: str
    probability: float
    alternatives: tuple[str, ...]
    parameters: Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Outcome:
    """One case.

    Attributes
    ----------
    name : str
        Of its files.
    stratum, motion : str
        As drawn.
    verdict : str
    stage : str
        Of the first place reported; empty if there is none.
    named : tuple of Named
        Most certain first.
    truth : mapping
        The sealed file, read after the report was written.
    second : mapping of str to (float, float, float)
        For each signal of the second recording, of joints that the first one moved: rmse of the
        nominal and of the augmented plant, and the noise, all of raw samples.
    runtime_s : float
    peers : mapping of str to str
        Effect that each peer named; empty where none was asked.
    """

    name: str
    stratum: str
    motion: str
    verdict: str
    stage: str
    named: tuple[Named, ...]
    truth: Mapping[str, Any]
    second: Mapping[str, tuple[float, float, float]]
    runtime_s: float
    peers: Mapping[str, str] = field(default_factory=dict)

    @property
    def concealed(self) -> tuple[str, ...]:
        """Return the ids of the concealed effects of the catalogue."""
        return tuple(self.truth['effects'])

    def ids(self) -> list[str]:
        """Return the ids of the named effects."""
        return [effect.id for effect in self.named]

    def listed(self) -> set[str]:
        """Return the ids of named effects and their alternatives."""
        return {*self.ids(), *(a for effect in self.named for a in effect.alternatives)}


def to_line(outcome: Outcome) -> str:
    """Return an outcome as one line of JSON."""
    return json.dumps(asdict(outcome))


def from_line(line: str) -> Outcome:
    """Read an outcome from one line of JSON.

    Raises
    ------
    ValueError
        If the line is no outcome.
    """
    content = json.loads(line)
    named = tuple(
        Named(
            **(
                n
                | {
                    'alternatives': tuple(n['alternatives']),
                    'parameters': {k: tuple(v) for k, v in n['parameters'].items()},
                }
            )
        )
        for n in content['named']
    )
    second = {k: tuple(v) for k, v in content['second'].items()}
    return Outcome(**(content | {'named': named, 'second': second}))
