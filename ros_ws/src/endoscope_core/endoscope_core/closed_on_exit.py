"""`with` for whatever has a `close`."""

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class ClosedOnExit(ABC):
    """Is closed at the end of its `with` block, whether that ends in an exception or not."""

    @abstractmethod
    def close(self) -> None:
        """Let go of everything it holds."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
