"""A slowly drifting estimate of how a rig differs from its description, and a test for jumps in it.

The difference is a vector b of numbers, one a direction; a residual follows S b + noise, S the
derivatives along the motion. b walks at random, slowly, and is estimated by the Kalman filter. The
last seconds do not enter the estimate, but are judged by it: for each moment since when b may have
jumped and for each change, the generalised likelihood ratio compares the data with and without the
jump (Willsky, Jones, IEEE Trans. Autom. Control 21(1), 1976). The largest one over all moments is
Page's cumulative sum (Biometrika 41, 1954) for a change of unknown size, over windows of limited
length (Lai, J. R. Stat. Soc. B 57(4), 1995): see Basseville, Nikiforov, Detection of Abrupt
Changes, 1993, ch. 2 and 7. The size of the noise is uncertain around the learnt one (Student's t),
so that a motion which the description predicts badly is not taken for a change.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GUESSED = 8.0
"""Blocks as which a first guess of the noise counts."""
REMEMBERED = 400.0
"""Blocks over which the noise is learnt."""
USUAL = 4.0
"""Independent residuals of a channel as which the learnt noise counts."""
TOGETHER = 5.0
"""Bins in a row whose residuals count as one."""
_NOTHING = 1e-9


@dataclass(frozen=True)
class ResidualBlock:
    """Residuals of C channels over a block, as products with the derivatives by D directions."""

    information: Array  # (C, D, D)
    score: Array  # (C, D)
    square: Array  # (C,)
    count: Array  # (C,) of bins

    @classmethod
    def of(cls, residual: Array, derivative: Array) -> Self:
        """From residuals (B, C), NaN where nothing was read, and derivatives (B, C, D)."""
        known = np.isfinite(residual)
        r = np.where(known, residual, 0.0).T
        s = np.where(known[..., None], derivative, 0.0).transpose(1, 2, 0)
        return cls(
            s @ s.transpose(0, 2, 1),
            (s @ r[..., None])[..., 0],
            np.sum(r * r, axis=1),
            known.sum(axis=0).astype(np.float64),
        )

    def flat(self) -> Array:
        """All of it in one row, which adds up over blocks."""
        return np.concatenate([np.ravel(each) for each in vars(self).values()])

    @staticmethod
    def split(rows: Array, channels: int, directions: int) -> tuple[Array, Array, Array, Array]:
        """Parts of rows (N, ...) that `flat` has made, each (N, ...)."""
        shapes = [(channels, directions, directions), (channels, directions), *[(channels,)] * 2]
        ends = np.cumsum([math.prod(shape) for shape in shapes])
        parts = np.split(rows, ends[:-1], axis=1)
        a, b, c, d = (x.reshape(-1, *shape) for x, shape in zip(parts, shapes, strict=True))
        return a, b, c, d

    def left(self, estimate: Array) -> Array:
        """Sum of squares (C,) that an estimate (D,) of the difference leaves."""
        explained = 2.0 * self.score @ estimate - (self.information @ estimate) @ estimate
        return np.maximum(self.square - explained, 0.0)


@dataclass(frozen=True)
class Jumps:
    """Result of W windows and K changes at one time."""

    gain: Array  # (W, K), of the likelihood's logarithm by a jump where a window begins
    size: Array  # (W, K), its likeliest size, in steps


class JumpTest:
    """Estimate and test of one joint."""

    def __init__(
        self,
        tolerance: Array,  # (D,), rms of each number of a healthy rig
        drift: Array,  # (D,), rms of its change in a block
        along: Array,  # (K, D), directions of the changes to detect
        one_way: NDArray[np.bool_],  # (K,), whether only a positive jump is one
        least: Array,  # (K,), smallest size of a jump
        noise: Array,  # (C,), first guess of the rms of a bin's residual
        # (W,), lengths that are tried, in blocks; the last is how old what enters the estimate is.
        windows: NDArray[np.int64],
    ) -> None:
        self._along, self._one_way, self._least = along, one_way, least
        self._windows = windows
        self._shape = len(noise), len(tolerance)
        self._estimate = np.zeros(len(tolerance))
        self._covariance = np.diag(tolerance**2)
        self._walk = np.diag(drift**2)
        self._square = GUESSED * noise**2
        self._blocks = np.full(len(noise), GUESSED)
        self._recent: deque[ResidualBlock] = deque()
        # Sums over all blocks until each of the recent ones.
        self._sums: deque[Array] = deque([np.zeros(1)], int(windows[-1]) + 1)
        self.learnt = 0  # blocks that have entered the estimate
        self.learning = True

    @property
    def noise(self) -> Array:
        """Rms (C,) of what the estimate leaves of a bin."""
        return np.sqrt(self._square / self._blocks)

    def interrupt(self) -> None:
        """Forget the blocks that have not entered the estimate."""
        self._recent.clear()
        self._sums.clear()
        self._sums.append(np.zeros(1))

    def add(self, block: ResidualBlock) -> Jumps | None:
        """Judge a block and those before; None until there are as many as the longest window."""
        self._recent.append(block)
        self._sums.append(self._sums[-1] + block.flat())
        if len(self._recent) <= self._windows[-1]:
            return None
        oldest = self._recent.popleft()
        if self.learning:
            self._learn(oldest)
        return self._judged()

    def _weights(self) -> Array:
        return self._blocks / (TOGETHER * self._square)

    def _learn(self, block: ResidualBlock) -> None:
        seen, count = block.count > 0, np.maximum(block.count, 1.0)
        left = block.left(self._estimate) / count
        # What the estimate's uncertainty leaves is no noise: it would hide jumps.
        unsure = np.einsum('cij,ij->c', block.information, self._covariance) / count
        fade = 1.0 - 1.0 / REMEMBERED
        learnt = fade * self._square + np.maximum(left - unsure, 0.25 * left)
        self._square = np.where(seen, learnt, self._square)
        self._blocks = np.where(seen, fade * self._blocks + 1.0, self._blocks)
        w = self._weights()
        information = np.tensordot(w, block.information, 1)
        score = w @ block.score - information @ self._estimate
        p = self._covariance + self._walk
        after = np.linalg.solve(np.eye(len(p)) + p @ information, p)
        self._estimate = self._estimate + after @ score
        self._covariance = 0.5 * (after + after.T)
        self.learnt += 1

    def _judged(self) -> Jumps:
        w, along = self._weights(), self._along.T
        now = self._sums[-1]
        by_channel, score, square, count = ResidualBlock.split(
            np.stack([now - self._sums[-1 - length] for length in self._windows]), *self._shape
        )
        by_channel = w[:, None, None] * by_channel
        score, square, count = w[:, None] * score, w * square, count / TOGETHER
        information = by_channel.sum(axis=1)
        # Score z and information M of a jump where b is known become (1 + M P)^-1 times those where
        # it is as uncertain as the estimate.
        z = score.sum(axis=1) - information @ self._estimate
        p = self._covariance + self._windows[:, None, None] * self._walk
        solved = np.linalg.solve(
            np.eye(len(self._estimate)) + information @ p, np.dstack([z, information @ along])
        )
        own = np.sum(along * solved[:, :, 1:], axis=1)
        size = np.where(own > _NOTHING, solved[:, :, 0] @ along / np.maximum(own, _NOTHING), 0.0)
        # Without a jump, and with each: the likeliest b, and how unlikely that is.
        sizes = np.pad(size, ((0, 0), (1, 0)))[:, None]
        force = solved[:, :, :1] - np.pad(solved[:, :, 1:], ((0, 0), (0, 0), (1, 0))) * sizes
        moved = p @ force
        unlikely = 0.5 * np.sum(force * moved, axis=1)
        b = self._estimate[:, None] + moved + np.pad(along, ((0, 0), (1, 0))) * sizes
        explained = 2.0 * score @ b - np.sum(b[:, None] * (by_channel @ b[:, None]), axis=2)
        left = np.maximum(square[..., None] - explained, 0.0)
        n = count[..., None]
        loss = 0.5 * (n + USUAL) * np.log((left + USUAL) / (n + USUAL))
        likelihood = -loss.sum(axis=1) - unlikely
        gain = likelihood[:, 1:] - likelihood[:, :1]
        reported = np.where(self._one_way, size, np.abs(size)) >= self._least
        return Jumps(np.where(reported, np.maximum(gain, 0.0), 0.0), size)
