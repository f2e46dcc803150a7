"""The parameters of the S-Graphs+ room segmentation, by default as published."""

from __future__ import annotations

import math
from dataclasses import dataclass

from semantics.freespace.gvd import GvdConfig
from semantics.freespace.places import PlacesConfig
from semantics.freespace.space import SpaceConfig
from semantics.freespace.tsdf import TsdfConfig

SKELETON = SpaceConfig(
    tsdf=TsdfConfig(voxel=0.2, truncation=0.4, window=10.0, coarser=1),
    gvd=GvdConfig(
        max_distance=5.0, min_distance=0.5, parents_apart=10**6, parents_cosine=math.cos(0.78)
    ),
    places=PlacesConfig(compression=0.35, min_node=0.5, min_edge=0.0, merge=0.0, least=1),
)
"""voxblox's skeleton of free space: 0.2 m voxels, vertices pruned within 0.35 m."""


@dataclass(frozen=True)
class SgraphsConfig:
    """The whole detector; lengths in metres.

    period: clusters are found anew every so many seconds [s]; clearance: narrower vertices are
    doorways; vertices, hull [m2], extent: what a cluster needs at least; near: a vertex this close
    to a plane votes for it; votes: that a plane needs; width: of a room, between two planes;
    aligned: more of a plane's points than this must lie on the room's side of each plane across;
    halves: a cluster with four planes that fails as a room may be a corridor of two (published: it
    is nothing); centre: farthest that a room's centre may be from a vertex; same_room: centres of
    one room are nearer than this; same_plane: how much two planes of one room that are the same may
    differ (rad and m together); overlap: two planes of one corridor are the same where more than
    ``overlapping`` points of one are this near to the other; window: planes seen within so many
    seconds take part [s].

    Published are 500 points for ``aligned`` and 100 for ``overlapping``, of a cloud that gathers a
    grid of 0.1 m anew from each keyframe, 2 m apart. Here a plane has one point for each cell of
    0.1 m, however often it was seen: 200 and 40 are what two or three keyframes make of them.

    faults: True puts the published faults back: axes of the map instead of the building, votes from
    behind a plane, a centre that depends on the map's origin and a width on its axes, the missing
    alignment test of y1, and corridors along x that are never recognised again.
    """

    space: SpaceConfig = SKELETON
    period: float = 5.0
    clearance: float = 0.8
    vertices: int = 10
    hull: float = 1.5
    extent: float = 0.5
    near: float = 1.0
    votes: int = 2
    width: float = 1.0
    aligned: int = 200
    halves: bool = False
    centre: float = 0.5
    same_room: float = 1.0
    same_plane: float = 0.5
    overlap: float = 1.0
    overlapping: int = 40
    window: float = 1.5
    faults: bool = False


PUBLISHED = SgraphsConfig()
TUNED = SgraphsConfig(window=20.0, clearance=0.6, votes=5, aligned=50, centre=1.5, same_room=3.0)
"""Best for a 16-beam sensor on generated buildings (``roomloop bench baselines``): a room
narrower than twice the published clearance, 1.6 m, is a doorway, and the walls of a room are not
all seen within 1.5 s."""

PRESETS = {
    "sgraphs": PUBLISHED,
    "sgraphs-faults": SgraphsConfig(faults=True),
    "sgraphs-tuned": TUNED,
}
