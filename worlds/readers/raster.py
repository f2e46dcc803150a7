"""Images as polygons: what is occupied, and what belongs to which room."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from slam.core import Array, InputError
from slam.plainfile import size_of
from worlds.drafting import as_multipolygon

MAX_PIXELS = 20_000_000
"""Largest image: 220 x 220 m at 5 cm."""
MAX_RUNS = 60_000
"""Most stretches of equal pixels that are made polygons of: an office floor has ten thousand."""

SIDE = 3
"""Corners between straight runs of at least this many pixels are corners of the building."""
INSET = 4.0
"""Of a longer side two points are kept, this far from its ends [pixels]."""
STEP = 0.75
"""What is left of the steps of a slanting line once their middles are joined [pixels]."""

Image = NDArray[np.int64]
Mask = NDArray[np.bool_]


def read_image(path: Path) -> tuple[NDArray[np.uint8] | NDArray[np.uint16], int]:
    """(H, W) or (H, W, C) values of an image as stored, and the largest that they can have.

    Palette images give the places in their palette. Raises InputError for what is no image, and for
    one larger than ``MAX_PIXELS``, before its pixels are read.
    """
    from PIL import Image as Pillow

    size_of(path)
    try:
        with Pillow.open(path, formats=("PPM", "PNG")) as image:
            if image.width * image.height > MAX_PIXELS:
                raise InputError(
                    f"{path}: {image.width} x {image.height} pixels, expected at most {MAX_PIXELS}"
                )
            values = np.asarray(image)
    except (OSError, SyntaxError, ValueError, Pillow.DecompressionBombError) as error:
        reason = getattr(error, "strerror", None) or (str(error).splitlines() or ["broken"])[0]
        raise InputError(f"{path}: expected an image (PGM or PNG): {reason}") from error
    if values.dtype == np.bool_:
        return values.astype(np.uint8) * np.uint8(255), 255
    if values.dtype == np.uint8:
        return values, 255
    if values.dtype.kind in "iu" and values.min() >= 0 and values.max() < 65536:
        return values.astype(np.uint16), 65535
    raise InputError(f"{path}: expected 8 or 16 bits a pixel, found {values.dtype}")


def regions(labels: Image, path: Path) -> dict[int, MultiPolygon]:
    """The polygon of every label but 0, in pixels: x right, y up, from the lower left corner.

    labels: (H, W), the top row first. Adjoining regions share their corners.
    """
    rows = labels[::-1]
    y, start, end, label = _runs(rows)
    if len(label) > MAX_RUNS:
        raise InputError(f"{path}: too ragged: more than {MAX_RUNS} stretches of equal pixels")
    boxes = shapely.box(start, y, end, y + 1)
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    return {
        int(label[group[0]]): as_multipolygon(shapely.union_all(boxes[group]))
        for group in np.split(order, cuts)
        if len(group)
    }


def _runs(rows: Image) -> tuple[Image, Image, Image, Image]:
    """Row, first column, column after the last, and value of each stretch of equal pixels."""
    height, width = rows.shape
    edge = np.ones((height, width), dtype=bool)
    edge[:, 1:] = rows[:, 1:] != rows[:, :-1]
    flat = np.flatnonzero(edge)
    ends = np.append(flat[1:], height * width)
    value = rows.ravel()[flat]
    kept = value != 0
    y, start = np.divmod(flat[kept], width)
    return y, start, ends[kept] - y * width, value[kept]


# --- pixels to straight lines --------------------------------------------------------------------


def joined_corners(mask: Mask) -> Mask:
    """The mask, one pixel more wherever two meet at a corner only: slanting walls stay whole."""
    a, b, c, d = mask[:-1, :-1], mask[:-1, 1:], mask[1:, :-1], mask[1:, 1:]
    found = mask.copy()
    found[1:, :-1] |= a & d & ~b & ~c
    found[1:, 1:] |= b & c & ~a & ~d
    return found


def straightened(shape: BaseGeometry) -> MultiPolygon:
    """An outline in pixels with its steps made straight, through their middles.

    Corners between two sides of at least ``SIDE`` pixels stay where they are.
    """
    smooth = [
        Polygon(_smooth(p.exterior.coords), [_smooth(hole.coords) for hole in p.interiors])
        for p in as_multipolygon(shape).geoms
    ]
    straight = shapely.simplify(shapely.make_valid(np.array(smooth)), STEP)
    return as_multipolygon(shapely.union_all(straight))


def _smooth(coords: Iterable[tuple[float, ...]]) -> Array:
    """(K, 2) the middles of the sides of a ring, both ends of long ones, and its true corners."""
    ring = np.asarray(coords)[:-1, :2]
    ring = ring[_turns(ring) != 0.0]
    run = np.roll(ring, -1, axis=0) - ring
    length = np.abs(run).sum(axis=1)
    kept = _true_corners(np.sign(_turns(ring)), length)
    points = []
    for k in range(len(ring)):
        if kept[k]:
            points.append(ring[k][None])
        inset = min(0.5, INSET / length[k])
        points.append(ring[k] + np.unique([inset, 1.0 - inset])[:, None] * run[k])
    return np.concatenate(points)


def _turns(ring: Array) -> Array:
    """(K,) cross product of the sides before and after each corner: 0 where it goes straight on."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]


def _true_corners(turn: Array, length: Array) -> Mask:
    """(K,) corners between long sides, and at both ends of a short side that caps a wall.

    length: of the side that begins at each corner.
    """
    long = length >= SIDE
    before = np.roll(long, 1)
    cap = (turn == np.roll(turn, -1)) & before & np.roll(long, -1)
    return (long & before) | cap | np.roll(cap, 1)
