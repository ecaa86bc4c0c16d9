"""Region anchors of a point cloud (Eqs. 5 to 7 of the Catalyst4D paper)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import _native
from ._arrays import as_numpy


@dataclass(frozen=True)
class Anchors:
    """Anchors of a cloud of N points."""

    positions: np.ndarray
    """Anchor positions, world units, [A,3]."""
    member_offsets: np.ndarray
    """Start of the members of each anchor, [A+1]."""
    members: np.ndarray
    """Point ids, anchor after anchor."""
    owners: np.ndarray
    """Anchor of each point, [N]; −1 for uncovered points."""
    lines: np.ndarray
    """Id of the retained line, [A]; −1 for anchors that need no line."""
    delta: float
    """Radius of the cylinder, world units."""
    num_ungrouped: int
    """Number of uncovered points without a neighbourhood."""
    num_unhit: int
    """Number of uncovered points whose neighbourhood no line hits."""

    def __len__(self) -> int:
        return len(self.positions)

    def members_of(self, anchor: int) -> np.ndarray:
        """Ids of the points that an anchor represents."""
        return self.members[self.member_offsets[anchor] : self.member_offsets[anchor + 1]]


def build(
    points: object,
    *,
    k: int = 2,
    grouping: str = "disjoint",
    max_edge_ratio: float = 4.0,
    radius: str | float = "global",
    radius_factor: float = 0.75**0.5,
    num_lines: int = 300_000,
    seed: int = 0,
) -> Anchors:
    """Anchors of a cloud: one per neighbourhood that fits into a thin cylinder around some line.

    Args:
        points: [N,3], world units.
        k: Number of nearest neighbours that form a neighbourhood with a point, 0 to 64.
        grouping: ``disjoint`` or ``overlapping`` neighbourhoods.
        max_edge_ratio: Disjoint neighbourhoods whose mean edge exceeds this multiple of the median
        are rejected.
        radius: ``global``, ``local``, or a radius in world units.
        radius_factor: Radius as a multiple of the mean member distance.
        num_lines: Lines sampled through the bounding sphere.
        seed: Seed of the lines.

    Raises:
        ValueError: For an empty cloud, non-finite coordinates, or parameters out of range.
    """
    cloud = as_numpy(points, np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise ValueError(f"points has shape {list(cloud.shape)}, expected [N, 3]")
    found = _native.build_anchors(
        cloud, k, grouping, max_edge_ratio, radius, radius_factor, num_lines, seed
    )
    return Anchors(**found)
