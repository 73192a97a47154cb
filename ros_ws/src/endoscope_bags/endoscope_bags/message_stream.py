"""Encoded messages of one topic, to be written together with those of others."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class MessageStream:
    """N encoded messages of one topic, for `BagWriter.write_streams`.

    Attributes
    ----------
    topic, type
        Full topic name and message type.
    payloads
        The encoded messages.
    log_ns
        Receipt in ns since the epoch, int64, shape (N,).
    publish_ns
        Publication, the same; None where it equals receipt.
    """

    topic: str
    type: str
    payloads: Sequence[bytes]
    log_ns: npt.NDArray[np.int64]
    publish_ns: npt.NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        for times in (self.log_ns, self.published_ns):
            if times.shape != (len(self.payloads),) or times.dtype != np.int64:
                raise ValueError(
                    f'{self.topic}: times {times.dtype} {times.shape} for '
                    f'{len(self.payloads)} messages; int64 of shape (N,) is due'
                )

    @property
    def published_ns(self) -> npt.NDArray[np.int64]:
        """Publication in ns since the epoch, shape (N,)."""
        return self.log_ns if self.publish_ns is None else self.publish_ns
