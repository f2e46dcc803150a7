"""A ROS occupancy map (the yaml and image of map_server) as a Plan.

    image: floor.pgm
    resolution: 0.05              # metres per pixel
    origin: [-10.0, -5.0, 0.0]    # x, y [m] of the lower left pixel's corner, and yaw [rad]
    negate: 0
    occupied_thresh: 0.65
    free_thresh: 0.196
    labels: rooms.png             # ours: which room each pixel belongs to

What is occupied becomes walls from floor to ceiling. In the image of labels each colour is a room;
0, black, white and transparent are none. A map without one has no word on rooms: its free areas
come as rooms of the kind ``UNLABELLED``, which are not truth.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label
from shapely.geometry import MultiPolygon

from slam.core import Array, InputError
from worlds.drafting import as_multipolygon
from worlds.plan import CEILING_WHERE_UNKNOWN, Plan, RoomOutline, Storey
from worlds.readers.freeareas import unlabelled
from worlds.readers.mapfile import MapFile, read_map_file
from worlds.readers.outlines import clean_walls
from worlds.readers.raster import Image, Mask, joined_corners, read_image, regions, straightened
from worlds.readers.roomset import sound_rooms
from worlds.readers.units import scale_to_metres

SPECK = 4
"""Occupied patches of fewer pixels are noise."""
NEAR = 3
"""A room reaches over unlabelled pixels this far to its walls [pixels]."""
LEAST_ROOM = 1.0
"""Patches of one label smaller than this are left out [m2]."""
MAX_LABELS = 10_000
"""Most colours of an image of labels; a photograph has more."""
NOTE = "An occupancy map: walls from floor to a ceiling assumed at 2.7 m."
NO_TRUTH = "No room truth: the rooms are the free areas."


def read_rosmap(path: Path) -> Plan:
    """The plan of an occupancy map. Raises InputError, with file, field and what was expected."""
    file = read_map_file(path)
    chance = _occupancy(file)
    occupied = _without_specks(chance > file.occupied)
    if not occupied.any():
        raise InputError(f"{file.image}: expected occupied pixels, found none")
    extent = np.array(occupied.shape[::-1]) * file.resolution
    scale_to_metres(path, extent, 1.0, None, "resolution")
    walls = clean_walls(file.placed(_walls(occupied, file)), waver=0.2 * file.resolution)
    labels = _labels(file, occupied.shape) if file.labels else None
    if labels is None:
        rooms = _free_rooms(file, walls, chance < file.free)
    else:
        rooms = _labelled_rooms(file, walls, labels, occupied)
    if not rooms:
        raise InputError(f"{file.labels or file.image}: expected rooms, found no free space")
    storey = Storey("0", 0.0, CEILING_WHERE_UNKNOWN, rooms, walls)
    return Plan(path.stem, (storey,), NOTE if file.labels else f"{NOTE} {NO_TRUTH}")


# --- walls ---------------------------------------------------------------------------------------


def _occupancy(file: MapFile) -> Array:
    """(H, W) how likely each pixel is occupied, as map_server reads it (mode trinary)."""
    values, most = read_image(file.image)
    if values.ndim == 3:
        colours = values.shape[2] - (values.shape[2] in (2, 4))
        values = values[:, :, :colours].mean(axis=2)
    share = values.astype(np.float64) / most
    return share if file.negate else 1.0 - share


def _without_specks(occupied: Mask) -> Mask:
    patches, _ = label(occupied, structure=np.ones((3, 3)))
    sizes = np.bincount(patches.ravel())
    return occupied & (sizes[patches] >= SPECK)


def _walls(occupied: Mask, file: MapFile) -> MultiPolygon:
    """The occupied pixels as polygons with straight sides, in pixels."""
    found = regions(joined_corners(occupied).astype(np.int64), file.image)
    return straightened(found[1])


# --- rooms ---------------------------------------------------------------------------------------


def _free_rooms(file: MapFile, walls: MultiPolygon, free: Mask) -> tuple[RoomOutline, ...]:
    reaching = distance_transform_edt(~free) <= NEAR if free.any() else free
    areas = regions(reaching.astype(np.int64), file.image).get(1, MultiPolygon())
    shape = file.placed(straightened(areas))
    return unlabelled([shape.difference(walls)])


def _labels(file: MapFile, shape: tuple[int, ...]) -> Image:
    """(H, W) a number for each room's colour, 0 for none."""
    assert file.labels is not None
    values, most = read_image(file.labels)
    if values.shape[:2] != shape:
        found = f"{values.shape[1]} x {values.shape[0]}"
        raise InputError(
            f"{file.labels}: expected the size of the map, {shape[1]} x {shape[0]}, found {found}"
        )
    keys = _keys(values, most)
    colours, index = np.unique(keys, return_inverse=True)
    if len(colours) > MAX_LABELS:
        raise InputError(f"{file.labels}: expected a colour for each room, found a picture")
    index = index.reshape(shape) + 1
    index[keys == 0] = 0
    return index.astype(np.int64)


def _keys(values: NDArray[np.uint8] | NDArray[np.uint16], most: int) -> Image:
    """One number for each colour; 0 for black, white and transparent ones."""
    if values.ndim == 2:
        return np.where(values == most, 0, values.astype(np.int64))
    with_alpha = values.shape[2] in (2, 4)
    colours = values.shape[2] - with_alpha
    key = np.zeros(values.shape[:2], dtype=np.int64)
    for k in range(colours):
        key = key * (most + 1) + values[:, :, k]
    key[(values[:, :, :colours] == most).all(axis=2)] = 0
    if with_alpha:
        key[values[:, :, -1] == 0] = 0
    return key


def _labelled_rooms(
    file: MapFile, walls: MultiPolygon, labels: Image, occupied: Mask
) -> tuple[RoomOutline, ...]:
    found = regions(_up_to_walls(labels, occupied), file.labels or file.image)
    numbers = sorted(found)
    # As one coverage: rooms that meet without a wall keep their common boundary.
    whole = shapely.coverage_simplify([found[n] for n in numbers], 1.5)
    rooms = []
    for place, shape in enumerate(whole, start=1):
        parts = as_multipolygon(file.placed(shapely.make_valid(shape))).geoms
        for part in parts:
            if part.area > LEAST_ROOM:
                rooms.append(RoomOutline(str(place), f"room {place}", "room", part))
    return sound_rooms(rooms, walls, walls, str(file.labels))


def _up_to_walls(labels: Image, occupied: Mask) -> Image:
    """The labels, each grown over what has none, as far as the middle of a wall."""
    distance, (row, column) = distance_transform_edt(labels == 0, return_indices=True)
    return np.where((distance <= NEAR) & (labels == 0), labels[row, column], labels)
