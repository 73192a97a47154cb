"""Parameters of a model as a mapping of their names, as files and messages carry them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Self


@dataclass(frozen=True)
class NamedNumbers:
    """Base of parameter sets whose fields are all numbers."""

    MODEL: ClassVar[str]
    """The model's name in messages."""

    def to_dict(self) -> dict[str, float]:
        """The parameters by name."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Parameters from a mapping of exactly their names.

        Raises ValueError: if a name is missing or unknown, or the parameters are unsafe.
        """
        wanted = {field.name for field in fields(cls)}
        if set(values) != wanted:
            odd = ', '.join(sorted(set(values) ^ wanted))
            raise ValueError(
                f'{cls.MODEL} parameters must be exactly {", ".join(sorted(wanted))}; '
                f'wrong or missing: {odd}'
            )
        return cls(**{name: float(value) for name, value in values.items()})
