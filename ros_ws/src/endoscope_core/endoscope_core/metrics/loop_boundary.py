"""Boundary of a cloud of points, as MATLAB's ``boundary`` draws it, and what it encloses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError

SHRINK = 0.5
MOST_POINTS = 4000

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LoopBoundary:
    """An alpha shape of the (desired, actual) cloud.

    Parameters
    ----------
    area : float
        Enclosed area; holes count as enclosed. In the product of the axes' units.
    height : float
        Extent of the enclosed region along the actual angle.
    width_at_middle : float
        Length of the cut through the region half-way up, along the desired angle.
    radius : float
        Alpha radius that was used.
    """

    area: float
    height: float
    width_at_middle: float
    radius: float

    @property
    def mean_width(self) -> float:
        """Area over height: the width, along the desired angle, of a strip as high and large."""
        return self.area / self.height


def loop_boundary(desired: ArrayLike, actual: ArrayLike, shrink: float = SHRINK) -> LoopBoundary:
    """Enclose the cloud of a hysteresis loop.

    The first paper (section 2.2) measures the backlash size with MATLAB's ``boundary`` at its
    default shrink factor 0.5. By that function's documentation factor 0 gives the convex hull and 1
    the tightest boundary that still encloses all points in one region; in between it is an alpha
    shape (Edelsbrunner, Kirkpatrick and Seidel 1983). Here: the Delaunay triangles whose
    circumscribed circle is not larger than the alpha radius; the radii at which that shape changes,
    from the least that leaves one region with every point, are ranked, and the one at the fraction
    ``1 - shrink`` of the rank is taken. Holes are filled, for ``boundary`` returns outlines.

    Of more than 4000 points every m-th is taken. Axes are scaled to the unit square for the
    triangles, so that the units of the angles do not matter.

    Parameters
    ----------
    desired, actual : array_like, shape (N,)
        Angles at the same instants.
    shrink : float
        In [0, 1].

    Raises
    ------
    ValueError
        If shapes or values are wrong or the points enclose no area.
    """
    points, scale = _unit_points(desired, actual)
    if not 0.0 <= shrink <= 1.0:
        raise ValueError(f'shrink = {shrink} must lie in [0, 1]')
    try:
        mesh = Delaunay(points)
    except QhullError as error:
        raise ValueError('the angles lie on one line and enclose no area') from error
    corners = points[mesh.simplices]
    radii = _circumradii(corners)
    radius = _chosen_radius(mesh, radii, len(points), shrink)
    inside = _without_holes(mesh, radii <= radius)
    enclosed = corners[inside]
    area = float(np.sum(_areas(enclosed)))
    low, high = float(enclosed[:, :, 1].min()), float(enclosed[:, :, 1].max())
    return LoopBoundary(
        area * scale[0] * scale[1],
        (high - low) * scale[1],
        _cut(enclosed, 0.5 * (low + high)) * scale[0],
        radius,
    )


def backlash_size_by_boundary(desired: ArrayLike, actual: ArrayLike) -> float:
    """Width of the boundary's region at the middle of its height, in the unit of `desired`.

    The paper says that the size was "gained using" ``boundary`` without saying what of it is the
    size; the width at mid-height is the one that agrees with the axes of its figures and with
    `width_at_mid_height` on a clean loop.
    """
    return loop_boundary(desired, actual).width_at_middle


def _unit_points(desired: ArrayLike, actual: ArrayLike) -> tuple[Array, Array]:
    u = np.asarray(desired, dtype=float)
    q = np.asarray(actual, dtype=float)
    if u.ndim != 1 or u.shape != q.shape:
        raise ValueError(
            f'desired {u.shape} and actual {q.shape} must be one-dimensional and equally long'
        )
    points = np.column_stack([u, q])
    if not np.all(np.isfinite(points)):
        raise ValueError('desired or actual holds values that are not finite')
    points = np.unique(points[:: max(1, -(-len(points) // MOST_POINTS))], axis=0)
    scale = np.ptp(points, axis=0) if len(points) else np.zeros(2)
    if len(points) < 3 or np.min(scale) == 0.0:
        raise ValueError('fewer than three different points, or all on one line: no area')
    return points / scale, scale


def _areas(corners: Array) -> Array:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas: Array = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return areas


def _circumradii(corners: Array) -> Array:
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    areas = _areas(corners)
    flat = areas <= 1e-14
    product = np.prod(sides, axis=1)
    radii: Array = np.where(flat, np.inf, product / (4.0 * np.where(flat, 1.0, areas)))
    return radii


def _chosen_radius(mesh: Delaunay, radii: Array, count: int, shrink: float) -> float:
    # Equal triangles differ by rounding: they belong together.
    spectrum = np.unique(radii[np.isfinite(radii)]) * (1.0 + 1e-9)
    low, high = 0, len(spectrum) - 1
    while low < high:
        middle = (low + high) // 2
        if _is_one_region(mesh, radii <= spectrum[middle], count):
            high = middle
        else:
            low = middle + 1
    ranked = spectrum[low:]
    return float(ranked[min(len(ranked) - 1, int((1.0 - shrink) * len(ranked)))])


def _is_one_region(mesh: Delaunay, inside: NDArray[np.bool_], count: int) -> bool:
    if np.unique(mesh.simplices[inside]).size < count:
        return False
    labels, chosen = _regions(mesh, inside)
    return np.unique(labels[chosen]).size == 1


def _regions(
    mesh: Delaunay, chosen: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    """Label of the region of triangles, joined over edges, and the indices of those chosen."""
    total = len(mesh.simplices)
    first = np.repeat(np.arange(total), 3)
    second = mesh.neighbors.ravel()
    joined = (second >= 0) & chosen[first] & chosen[second]
    graph = coo_matrix(
        (np.ones(np.count_nonzero(joined)), (first[joined], second[joined])), shape=(total, total)
    )
    return connected_components(graph, directed=False)[1], np.flatnonzero(chosen)


def _without_holes(mesh: Delaunay, inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    labels, outside = _regions(mesh, ~inside)
    at_hull = np.any(mesh.neighbors < 0, axis=1) & ~inside
    open_regions = np.unique(labels[at_hull])
    filled = inside.copy()
    filled[outside] = ~np.isin(labels[outside], open_regions)
    return filled


def _cut(corners: Array, level: float) -> float:
    """Total length of the horizontal cut through triangles (T, 3, 2) at a height."""
    total = 0.0
    for triangle in corners:
        crossings = []
        for (x0, y0), (x1, y1) in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
            # Half-open, so that a corner on the level counts once.
            if (y0 < level) != (y1 < level):
                crossings.append(x0 + (level - y0) / (y1 - y0) * (x1 - x0))
        if len(crossings) == 2:
            total += abs(crossings[1] - crossings[0])
    return total
