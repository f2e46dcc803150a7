"""Free-space clusters: what remains of the skeleton when doorways are taken out."""

from __future__ import annotations

import numpy as np
from shapely.geometry import MultiPoint

from semantics.freespace.places import Places, components
from semantics.sgraphs.config import SgraphsConfig
from slam.core import Array


def clusters_of(skeleton: Places, config: SgraphsConfig) -> list[Array]:
    """Vertices (V, 2) in plan view of each cluster that is large enough for a room, map frame."""
    wide = skeleton.clearance > config.clearance
    inner = skeleton.edges[wide[skeleton.edges].all(axis=1)]
    group = components(len(skeleton), inner)
    group[~wide] = -1
    beside = skeleton.edges[wide[skeleton.edges].sum(axis=1) == 1]
    for a, b in beside.tolist():  # a doorway joins the cluster of its first neighbour
        door, other = (b, a) if wide[a] else (a, b)
        if group[door] < 0:
            group[door] = group[other]
    found = [skeleton.positions[group == label, :2] for label in np.unique(group[wide])]
    return [vertices for vertices in found if _is_large(vertices, config)]


def _is_large(vertices: Array, config: SgraphsConfig) -> bool:
    if len(vertices) < config.vertices or MultiPoint(vertices).convex_hull.area < config.hull:
        return False
    return bool((np.ptp(vertices, axis=0) >= config.extent).all())
