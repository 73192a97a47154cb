"""What the size model reads of a calibration: the course of both wires' tensions of each joint."""

from torch import Tensor

BIN = 50
WIRES_OF_A_JOINT = 2
SLACK = 0.5
"""Tension in N that is added before the logarithm, which a slack wire has none of."""


def log_courses(tension: Tensor) -> Tensor:
    """Logarithms of tensions averaged over 50 ms, (R, J, 2 B), the positive wire's first.

    Recordings begin at the same place on the loop, so that an instant of one is a place on it:
    these are the tension loops themselves, with a seventh of the cells' noise.

    Parameters
    ----------
    tension : Tensor, shape (R, N, 2 J)
        N at 1 kHz, two wires a joint. Samples after the last whole 50 ms are left out.
    """
    recordings, samples, wires = tension.shape
    bins = samples // BIN
    mean = tension[:, : bins * BIN].reshape(recordings, bins, BIN, wires).mean(dim=2)
    by_joint = mean.reshape(recordings, bins, wires // WIRES_OF_A_JOINT, WIRES_OF_A_JOINT)
    return by_joint.permute(0, 2, 3, 1).flatten(2).clamp(min=0.0).add(SLACK).log()


def roughness(tension: Tensor) -> Tensor:
    """Noise of each cell in N rms (R, J, 2), from second differences.

    Smooth motion adds next to nothing to a second difference at 1 kHz, and white noise has
    sqrt(6) times its own rms in it.
    """
    bend = tension[:, 2:] - 2.0 * tension[:, 1:-1] + tension[:, :-2]
    rms = bend.square().mean(dim=1).div(6.0).sqrt()
    return rms.unflatten(1, (-1, WIRES_OF_A_JOINT))
