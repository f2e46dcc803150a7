"""Mapped planes: what each one really is, how whole the map is, and how far the planes are off.

A mapped plane's true surface is the majority label of the points it was built from, coplanar and
same-facing faces counting as one surface; under 60 % it is mixed. Floors and ceilings are surfaces
too (one per storey); what is neither (jambs, outer walls, furniture) has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eval.score.surfaces import Surface, Surfaces
from eval.score.trajectory import rms
from eval.score.votes import Labels
from eval.seen import SeenFaces
from slam.core import Array, MapPlane, transform_points
from worlds.truth import CEILING, FLOOR, LABELS, Face, Truth

MIXED_BELOW = 0.6
OVERLAP = 0.1
"""Extents overlap when they share more than this in both directions [m]."""
STEP = 0.1
"""Spacing of the samples on an estimated segment [m]."""


@dataclass(frozen=True)
class LabelledPlane:
    """A mapped plane with the truth of its points: faces (M,), along (M,), points_world (M, 3)."""

    plane: MapPlane
    faces: Labels
    along: Array
    points_world: Array


@dataclass(frozen=True)
class PlaneVote:
    """surface: what most points lie on, None without points; share: of the points, in [0, 1].

    extent: (2, 2) [low, high] of those points, along the surface and in height (walls) or x and y.
    """

    plane_id: int
    surface: Surface | None
    share: float
    extent: Array

    @property
    def mixed(self) -> bool:
        """No surface has 60 % of the points."""
        return self.share < MIXED_BELOW - 1e-9

    @property
    def face_surface(self) -> int | None:
        """The surface id of a plane that is not mixed and lies on faces."""
        if self.surface is None or self.mixed or self.surface[0] != 0:
            return None
        return self.surface[1]

    @property
    def label(self) -> str:
        """For people: "surface 3", "mixed", or what else its points are on, such as "floor"."""
        if self.surface is None or self.mixed:
            return "mixed"
        kind, surface = self.surface
        return f"surface {surface}" if kind == 0 else _NAMES[kind]


_NAMES = {label: name for name, label in LABELS.items()}


@dataclass(frozen=True)
class PlaneScore:
    """The figures of metrics.json's ``planes``, ``map_completeness`` and ``plane_rmse_m``.

    mapped: all planes, level ones too; duplicates: planes beyond the largest of those that share a
    surface and overlap; mapped_faces: seen faces with at least half of their seen length on one
    plane that is not mixed and whose surface is theirs; plane_rmse: samples every 10 cm along the
    estimated segments, at the foot, middle and top of each, to the face they belong to, over planes
    on faces that are not mixed. All but mapped are None where nothing is known of the place.
    """

    mapped: int
    mixed: int | None = None
    duplicates: int | None = None
    faces_seen: int | None = None
    completeness: float | None = None
    plane_rmse: float | None = None
    mapped_faces: frozenset[int] = frozenset()
    votes: tuple[PlaneVote, ...] = ()


def vote_plane(labelled: LabelledPlane, surfaces: Surfaces) -> PlaneVote:
    """The majority surface of a mapped plane; a tie goes to the lowest."""
    if len(labelled.faces) == 0:
        return PlaneVote(labelled.plane.id, None, 0.0, np.zeros((2, 2)))
    codes = surfaces.codes(labelled.faces, labelled.points_world)
    values, counts = np.unique(codes, return_counts=True)
    best = int(counts.argmax())
    surface = surfaces.decode(int(values[best]))
    places = surfaces.places(surface, labelled.points_world[codes == values[best]])
    extent = np.percentile(places, [1.0, 99.0], axis=0)
    return PlaneVote(labelled.plane.id, surface, float(counts[best] / len(codes)), extent)


def duplicate_planes(votes: Sequence[PlaneVote], sizes: Sequence[int]) -> frozenset[int]:
    """Ids of planes that overlap a larger one of the same surface; mixed ones have no surface."""
    kept: list[PlaneVote] = []
    duplicates: set[int] = set()
    for _, vote in sorted(
        zip(sizes, votes, strict=True), key=lambda pair: (-pair[0], pair[1].plane_id)
    ):
        if vote.mixed or vote.surface is None or not _is_surface(vote.surface):
            continue
        if any(other.surface == vote.surface and _overlap(other, vote) for other in kept):
            duplicates.add(vote.plane_id)
        else:
            kept.append(vote)
    return frozenset(duplicates)


def _is_surface(surface: Surface) -> bool:
    return surface[0] in (0, FLOOR, CEILING)


def _overlap(a: PlaneVote, b: PlaneVote) -> bool:
    shared = np.minimum(a.extent[1], b.extent[1]) - np.maximum(a.extent[0], b.extent[0])
    return bool((shared > OVERLAP).all())


def mapped_faces(
    planes: Sequence[LabelledPlane], votes: Sequence[PlaneVote], truth: Truth, seen: SeenFaces
) -> frozenset[int]:
    """Seen faces with at least half of their seen length on one plane, see ``PlaneScore``."""
    held: set[int] = set()
    for labelled, vote in zip(planes, votes, strict=True):
        for face in _faces_on(vote.face_surface, labelled, truth):
            along = labelled.along[labelled.faces == face]
            covered = seen.covered(face, [(float(along.min()), float(along.max()))])
            if covered > 0.0 and covered >= 0.5 * seen.length(face) - 1e-9:
                held.add(face)
    return frozenset(held)


def _faces_on(surface: int | None, labelled: LabelledPlane, truth: Truth) -> list[int]:
    present = (int(face) for face in np.unique(labelled.faces) if face >= 0)
    return [face for face in present if truth.faces[face].surface == surface]


def samples_on_plane(plane: MapPlane) -> Array:
    """(S, 3) points of a mapped wall plane, map frame: every 10 cm of its segment, at 3 heights."""
    start, end = plane.segment
    count = max(2, int(np.ceil(np.linalg.norm(end - start) / STEP)) + 1)
    places = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
    heights = np.linspace(*plane.z_range, 3)
    points = np.column_stack([np.tile(places, (3, 1)), np.repeat(heights, count)])
    return points - np.outer(points @ plane.normal + plane.d, plane.normal)


def feet_on_faces(points: Array, faces: Sequence[Face]) -> Array:
    """(S, 3) where points (S, 3), world, would lie on the stretch of face beside which each is."""
    parts = [(part, face) for face in faces for part in face.parts]
    nearest = np.array([_beyond(points, part) for part, _ in parts]).argmin(axis=0)
    feet = points.copy()
    for place in np.unique(nearest):
        part, face = parts[place]
        on = nearest == place
        feet[on] -= np.outer(_across(points[on], part, face), face.normal)
    return feet


def plane_errors(plane: MapPlane, faces: Sequence[Face], T_world_map: Array) -> Array:
    """(S,) distances of a plane's samples to the stretch of true face beside which each lies.

    A face may run over several wall bodies, each built a little off the others: each stretch has
    its own line in plan view, and the lean of its face.
    """
    points = transform_points(T_world_map, samples_on_plane(plane))
    parts = [(part, face) for face in faces for part in face.parts]
    aside = np.array([_beyond(points, part) for part, _ in parts])
    across = np.array([_across(points, part, face) for part, face in parts])
    return across[aside.argmin(axis=0), np.arange(len(points))]


def _beyond(points: Array, part: Array) -> Array:
    """(S,) how far beyond the ends (2, 2) of a stretch points lie, along it [m]."""
    length = float(np.linalg.norm(part[1] - part[0]))
    along = (points[:, :2] - part[0]) @ (part[1] - part[0]) / length
    return np.maximum(np.maximum(-along, along - length), 0.0)


def _across(points: Array, part: Array, face: Face) -> Array:
    """(S,) signed distances to the plane through a stretch at mid height, as steep as its face."""
    along = (part[1] - part[0]) / np.linalg.norm(part[1] - part[0])
    level = np.array([-along[1], along[0]])
    level *= np.copysign(np.hypot(*face.normal[:2]), level @ face.normal[:2])
    middle = np.array([*part.mean(axis=0), sum(face.z_range) / 2.0])
    return (points - middle) @ np.array([*level, face.normal[2]])


def score_planes(
    planes: Sequence[LabelledPlane], truth: Truth, seen: SeenFaces, T_world_map: Array | None
) -> PlaneScore:
    """Score the final map; ``plane_rmse`` is None without an alignment."""
    surfaces = Surfaces(truth)
    votes = tuple(vote_plane(labelled, surfaces) for labelled in planes)
    held = mapped_faces(planes, votes, truth, seen)
    faces_seen = int(seen.seen.sum())
    errors = [
        plane_errors(labelled.plane, surfaces.faces(vote.face_surface), T_world_map)
        for labelled, vote in zip(planes, votes, strict=True)
        if T_world_map is not None and vote.face_surface is not None
    ]
    return PlaneScore(
        mapped=len(planes),
        mixed=sum(vote.mixed for vote in votes),
        duplicates=len(duplicate_planes(votes, [len(p.faces) for p in planes])),
        faces_seen=faces_seen,
        completeness=len(held) / faces_seen if faces_seen else None,
        plane_rmse=rms(np.concatenate(errors)) if errors else None,
        mapped_faces=held,
        votes=votes,
    )
