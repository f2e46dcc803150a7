"""Where the rooms of a random building lie: axis-parallel rectangles with walls between them."""

from __future__ import annotations

import numpy as np

from slam.core import Array
from worlds.generator.config import GeneratorConfig

Rect = tuple[float, float, float, float]
"""x_min, y_min, x_max, y_max of a clear rectangle [m]."""


def draw_layout(
    rng: np.random.Generator, config: GeneratorConfig, kind: str, gap: float
) -> tuple[list[Rect], set[int]]:
    """The clear rectangles of a building of one kind, walls of thickness gap [m] between them, and
    which of them are corridors."""
    rects, corridors = _KINDS[kind](rng, config, gap)
    if config.cross > 0.0:
        rects, corridors = _crossed(rng, config, rects, corridors, gap)
    return rects, corridors


def _widths(rng: np.random.Generator, total: float, low: float, high: float, gap: float) -> Array:
    """Random widths with gaps between them that fill ``total`` exactly; each at least ``low``."""
    count = max(1, int((total + gap) // (low + gap)))
    widths: list[float] = []
    while len(widths) < count:
        left = total - sum(widths) - gap * len(widths)
        if left < 2 * low + gap:
            widths.append(left)
            break
        widths.append(float(min(rng.uniform(low, high), left)))
        if total - sum(widths) - gap * len(widths) < low:
            widths[-1] = left
            break
    return np.asarray(widths)


def _row(rng: np.random.Generator, config: GeneratorConfig, rect: Rect, gap: float) -> list[Rect]:
    """Rooms side by side along x that fill a rectangle."""
    x0, y0, x1, y1 = rect
    high = float(rng.uniform(config.room_width[0] + 1.0, config.room_width[1]))
    widths = _widths(rng, x1 - x0, config.room_width[0], high, gap)
    starts = x0 + np.concatenate([[0.0], np.cumsum(widths[:-1] + gap)])
    return [(float(s), y0, float(s + w), y1) for s, w in zip(starts, widths, strict=True)]


def _split(
    rng: np.random.Generator, config: GeneratorConfig, rect: Rect, gap: float, stop: float
) -> list[Rect]:
    """Cut a rectangle in two, and those again, until the pieces are room-sized."""
    x0, y0, x1, y1 = rect
    width, depth = x1 - x0, y1 - y0
    low = config.room_width[0]
    longest = max(width, depth)
    if longest < 2 * low + gap or (longest < stop and rng.random() < 0.7):
        return [rect]
    if width < depth:
        turned = _split(rng, config, (y0, x0, y1, x1), gap, stop)
        return [(b, a, d, c) for a, b, c, d in turned]
    cut = float(x0 + rng.uniform(low, width - low - gap))
    left = _split(rng, config, (x0, y0, cut, y1), gap, stop)
    return left + _split(rng, config, (cut + gap, y0, x1, y1), gap, stop)


def _corridor(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """A corridor with rooms on both sides, sometimes on one."""
    length = float(rng.uniform(*config.corridor_length))
    width = float(rng.uniform(*config.corridor_width))
    rects: list[Rect] = [(0.0, 0.0, length, width)]
    depth = float(rng.uniform(*config.room_depth))
    rects += _row(rng, config, (0.0, width + gap, length, width + gap + depth), gap)
    if rng.random() < 0.8:
        depth = float(rng.uniform(*config.room_depth))
        rects += _row(rng, config, (0.0, -gap - depth, length, -gap), gap)
    return rects, {0}


def _spine(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """A corridor through an office floor whose halves are split at random."""
    length = float(rng.uniform(*config.floor_side))
    width = float(rng.uniform(*config.corridor_width))
    stop = float(rng.uniform(3.0, 9.0))
    rects: list[Rect] = [(0.0, 0.0, length, width)]
    for sign in (1.0, -1.0):
        depth = float(rng.uniform(3.0, 11.0))
        low = width + gap if sign > 0 else -gap - depth
        rects += _split(rng, config, (0.0, low, length, low + depth), gap, stop)
    return rects, {0}


def _floor(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """An office floor split at random, without a corridor."""
    rect = (0.0, 0.0, float(rng.uniform(*config.floor_side)), float(rng.uniform(6.0, 18.0)))
    return _split(rng, config, rect, gap, float(rng.uniform(3.0, 9.0))), set()


def _cluster(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """A few rooms side by side: a flat, a site hut."""
    rect = (0.0, 0.0, float(rng.uniform(4.0, 12.0)), float(rng.uniform(3.0, 10.0)))
    return _split(rng, config, rect, gap, float(rng.uniform(3.5, 7.0))), set()


def _hall(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """One large room with smaller ones along one or two of its sides."""
    length, depth = (float(v) for v in rng.uniform(*config.hall_side, 2))
    rects: list[Rect] = [(0.0, 0.0, length, depth)]
    side = float(rng.uniform(*config.room_depth))
    rects += _row(rng, config, (0.0, depth + gap, length, depth + gap + side), gap)
    if rng.random() < 0.5:
        side = float(rng.uniform(*config.room_depth))
        rects += _row(rng, config, (0.0, -gap - side, length, -gap), gap)
    return rects, set()


def _wings(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """A corridor round a corner, or two with a wall at the corner; rooms along the outside, and a
    hall, rooms or nothing inside."""
    a, b = (float(v) for v in rng.uniform(10.0, 28.0, 2))
    width = float(rng.uniform(1.5, 4.0))
    below, beside = (float(v) for v in rng.uniform(*config.room_depth, 2))
    corner = gap if config.cross > 0.0 and rng.random() < config.cross else 0.0
    rects: list[Rect] = [(0.0, 0.0, a, width), (a - width, width + corner, a, b)]
    rects += _row(rng, config, (0.0, -gap - below, a, -gap), gap)
    turned = _row(rng, config, (0.0, a + gap, b, a + gap + beside), gap)
    rects += [(y0, x0, y1, x1) for x0, y0, x1, y1 in turned]
    inner = (0.0, width + gap, a - width - gap, b)
    inside = float(rng.random())
    if inside < 0.4:
        rects.append(inner)
    elif inside < 0.7:
        rects += _split(rng, config, inner, gap, float(rng.uniform(4.0, 9.0)))
    return rects, {0, 1}


def _blocks(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """Two corridors side by side, with one to three across between them and rooms between those;
    rooms along one of the two, or both."""
    length, depth = float(rng.uniform(*config.corridor_length)), float(rng.uniform(4.0, 12.0))
    low, high, across = (float(w) for w in rng.uniform(*config.corridor_width, 3))
    top = low + gap + depth + gap
    halls: list[Rect] = [(0.0, 0.0, length, low), (0.0, top, length, top + high)]
    rooms: list[Rect] = []
    fit = int((length + gap) // (across + config.room_width[0] + 2 * gap))
    count = min(int(rng.integers(1, 4)), max(fit, 1))
    free = max(length - count * (across + gap), 0.0)
    start = 0.0
    for share in rng.dirichlet(np.ones(count + 1)) * free:
        width = float(share) - gap
        if width >= config.room_width[0]:
            block = (start, low + gap, start + width, top - gap)
            rooms += _split(rng, config, block, gap, float(rng.uniform(3.0, 9.0)))
            start += width + gap
        if len(halls) < 2 + count:
            halls.append((start, low + gap, start + across, top - gap))
            start += across + gap
    beside = float(rng.uniform(*config.room_depth))
    rooms += _row(rng, config, (0.0, -gap - beside, length, -gap), gap)
    if rng.random() < 0.5:
        beside = float(rng.uniform(*config.room_depth))
        end = top + high + gap
        rooms += _row(rng, config, (0.0, end, length, end + beside), gap)
    return halls + rooms, set(range(len(halls)))


def _crossed(
    rng: np.random.Generator,
    config: GeneratorConfig,
    rects: list[Rect],
    corridors: set[int],
    gap: float,
) -> tuple[list[Rect], set[int]]:
    """Some long corridors divided by a cross wall."""
    parts: list[Rect] = []
    halls: set[int] = set()
    for i, rect in enumerate(rects):
        x0, y0, x1, y1 = rect
        long = max(x1 - x0, y1 - y0)
        if i in corridors and long > 8.0 and rng.random() < config.cross:
            cut = float(rng.uniform(3.0, long - 3.0 - gap))
            wide = x1 - x0 >= y1 - y0
            first = (x0, y0, x0 + cut, y1) if wide else (x0, y0, x1, y0 + cut)
            rest = (x0 + cut + gap, y0, x1, y1) if wide else (x0, y0 + cut + gap, x1, y1)
            halls |= {len(parts), len(parts) + 1}
            parts += [first, rest]
        else:
            halls |= {len(parts)} if i in corridors else set()
            parts.append(rect)
    return parts, halls


_KINDS = {
    "wings": _wings,
    "blocks": _blocks,
    "corridor": _corridor,
    "spine": _spine,
    "split": _floor,
    "cluster": _cluster,
    "hall": _hall,
}
