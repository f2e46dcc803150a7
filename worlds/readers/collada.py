"""Triangles of a COLLADA (DAE) file, streamed through expat; no document type, no entities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from slam.core import Array, InputError, IntArray, so3_exp

MAX_DEPTH = 100
"""Deepest nesting of nodes."""
MAX_INSTANCES = 200_000
"""Most geometries that a scene can place."""


@dataclass
class Triangles:
    """vertices: (V, 3) as in the file, in scene coordinates; faces: (T, 3); unit: metres per unit
    or None; up: y, z or None, as declared."""

    vertices: Array
    faces: IntArray
    unit: float | None = None
    up: str | None = None


@dataclass
class _Document:
    path: Path
    root: Element
    by_id: dict[str, Element] = field(default_factory=dict)

    def fail(self, expected: str) -> InputError:
        return InputError(f"{self.path}: {expected}")

    def target(self, element: Element) -> Element:
        url = element.get("url") or element.get("source") or ""
        if url.lstrip("#") not in self.by_id:
            raise self.fail(f'<{element.tag}>: nothing has the id "{url}"')
        return self.by_id[url.lstrip("#")]


def read_collada(path: Path, most: int) -> Triangles:
    """All triangles of the scene. Raises InputError for what is no COLLADA, for one with a document
    type or entities, and for more than ``most`` triangles."""
    root = _parse(path)
    if root.tag != "COLLADA":
        raise InputError(f"{path}: expected COLLADA, found <{root.tag}>")
    document = _Document(path, root, {e.get("id", ""): e for e in root.iter() if e.get("id")})
    found, count = [], 0
    for instance, T in _instances(document):
        vertices, faces = _geometry(document, instance)
        count += len(faces)
        if count > most:
            raise InputError(f"{path}: expected at most {most} triangles")
        found.append((vertices @ T[:3, :3].T + T[:3, 3], faces))
    sizes = np.cumsum([0, *(len(v) for v, _ in found)])
    shifted = [f + n for (_, f), n in zip(found, sizes, strict=False)]
    return Triangles(
        np.concatenate([np.empty((0, 3)), *(v for v, _ in found)]),
        np.concatenate([np.empty((0, 3), np.int64), *shifted]),
        _unit(document),
        _up(document),
    )


def _parse(path: Path) -> Element:
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def refuse(*_: object) -> None:
        raise InputError(f"{path}: expected COLLADA without a document type and entities")

    parser.StartElementHandler = lambda tag, attributes: builder.start(_local(tag), attributes)
    parser.EndElementHandler = lambda tag: builder.end(_local(tag))
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        with path.open("rb") as file:
            parser.ParseFile(file)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise InputError(f"{path}: expected COLLADA: {error}") from error
    return builder.close()


def _local(tag: str) -> str:
    return tag.rsplit(":", 1)[-1]


def _unit(document: _Document) -> float | None:
    element = document.root.find("asset/unit")
    text = element.get("meter") if element is not None else None
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (np.isfinite(value) and value > 0.0):
        raise document.fail(f'asset/unit: expected meter="a number above 0", found "{text}"')
    return value


def _up(document: _Document) -> str | None:
    word = (document.root.findtext("asset/up_axis") or "").strip().upper()
    if word == "X_UP":
        raise document.fail("asset/up_axis: expected Y_UP or Z_UP, found X_UP")
    return {"Y_UP": "y", "Z_UP": "z"}.get(word)


# --- the scene -----------------------------------------------------------------------------------


def _instances(document: _Document) -> Iterator[tuple[Element, Array]]:
    """Every geometry that the scene places, with the matrix that places it."""
    shown = document.root.find("scene/instance_visual_scene")
    if shown is None:
        raise document.fail("scene: expected an instance_visual_scene")
    pending = [(node, np.eye(4), 0) for node in document.target(shown).findall("node")]
    placed = 0
    while pending:
        node, T_parent, depth = pending.pop()
        placed += 1
        if depth > MAX_DEPTH or placed > MAX_INSTANCES:
            raise document.fail("expected a scene with fewer nodes, found one without end")
        T = T_parent @ _placement(document, node)
        for instance in node.findall("instance_geometry"):
            yield document.target(instance), T
        below = [document.target(i) for i in node.findall("instance_node")]
        pending += [(child, T, depth + 1) for child in (*node.findall("node"), *below)]


def _placement(document: _Document, node: Element) -> Array:
    T = np.eye(4)
    for element in node:
        if element.tag in ("matrix", "translate", "scale", "rotate"):
            T = T @ _motion(document, element)
    return T


def _motion(document: _Document, element: Element) -> Array:
    sizes = {"matrix": 16, "translate": 3, "scale": 3, "rotate": 4}
    values = _numbers(document, element)
    if len(values) != sizes[element.tag]:
        raise document.fail(f"<{element.tag}>: expected {sizes[element.tag]} numbers")
    T = np.eye(4)
    if element.tag == "matrix":
        return values.reshape(4, 4)
    if element.tag == "translate":
        T[:3, 3] = values
    elif element.tag == "scale":
        T[:3, :3] = np.diag(values)
    else:
        axis = values[:3] / max(float(np.linalg.norm(values[:3])), 1e-12)
        T[:3, :3] = so3_exp(np.radians(values[3]) * axis)
    return T


# --- geometry ------------------------------------------------------------------------------------


def _geometry(document: _Document, geometry: Element) -> tuple[Array, IntArray]:
    """(V, 3) vertices and (T, 3) triangles of a mesh."""
    mesh = geometry.find("mesh")
    vertices, triangles = np.empty((0, 3)), [np.empty((0, 3), np.int64)]
    for primitive in mesh if mesh is not None else ():
        if primitive.tag in ("triangles", "polylist", "polygons"):
            points, corners = _primitive(document, primitive)
            triangles.append(corners + len(vertices))
            vertices = np.concatenate([vertices, points])
    return vertices, np.concatenate(triangles)


def _primitive(document: _Document, primitive: Element) -> tuple[Array, IntArray]:
    inputs = primitive.findall("input")
    stride = 1 + max((_whole(document, i, "offset", 0) for i in inputs), default=0)
    vertex = next((i for i in inputs if i.get("semantic") == "VERTEX"), None)
    if vertex is None:
        raise document.fail(f"<{primitive.tag}>: expected an input VERTEX")
    points = _positions(document, document.target(vertex))
    rings = [_indices(document, p) for p in primitive.findall("p")]
    if any(len(ring) % stride for ring in rings):
        raise document.fail(f"<{primitive.tag}>: expected {stride} indices a corner")
    offset = _whole(document, vertex, "offset", 0)
    corners = [ring.reshape(-1, stride)[:, offset] for ring in rings]
    faces = _triangulated(document, primitive, corners)
    if len(faces) and faces.max() >= len(points):
        raise document.fail(f"<{primitive.tag}>: expected indices below {len(points)}")
    return points, faces


def _positions(document: _Document, vertices: Element) -> Array:
    entry = next((i for i in vertices.findall("input") if i.get("semantic") == "POSITION"), None)
    source = document.target(entry) if entry is not None else vertices
    array = source.find("float_array")
    values = _numbers(document, array) if array is not None else np.empty(0)
    accessor = source.find("technique_common/accessor")
    stride = _whole(document, accessor, "stride", 3) if accessor is not None else 3
    if stride < 3 or not len(values) or len(values) % stride:
        raise document.fail("<source>: expected points of three coordinates")
    return values.reshape(-1, stride)[:, :3]


def _triangulated(document: _Document, primitive: Element, rings: list[IntArray]) -> IntArray:
    """(T, 3) triangles: fans of the polygons."""
    if primitive.tag == "triangles":
        flat = np.concatenate([np.empty(0, np.int64), *rings])
        if len(flat) % 3:
            raise document.fail("<triangles>: expected three corners each")
        return flat.reshape(-1, 3)
    if primitive.tag == "polylist":
        flat = np.concatenate([np.empty(0, np.int64), *rings])
        vcount = primitive.find("vcount")
        counts = _indices(document, vcount) if vcount is not None else flat[:0]
        if counts.sum() != len(flat):
            raise document.fail("<vcount>: expected as many corners as <p> has")
        rings = np.split(flat, np.cumsum(counts)[:-1])
    fans = [np.stack([np.full(len(r) - 2, r[0]), r[1:-1], r[2:]], 1) for r in rings if len(r) > 2]
    return np.concatenate([np.empty((0, 3), np.int64), *fans])


def _whole(document: _Document, element: Element, key: str, otherwise: int) -> int:
    """A small whole number from an attribute."""
    text = element.get(key, str(otherwise))
    if not (text.isascii() and text.isdigit() and len(text) < 4):
        raise document.fail(f'<{element.tag} {key}="{text[:20]}">: expected a whole number')
    return int(text)


def _indices(document: _Document, element: Element) -> IntArray:
    values = _numbers(document, element)
    if not ((values >= 0.0) & (values < 2**31) & (values == np.floor(values))).all():
        raise document.fail(f"<{element.tag}>: expected whole numbers from 0")
    return values.astype(np.int64)


def _numbers(document: _Document, element: Element) -> Array:
    try:
        values = np.array((element.text or "").split(), dtype=np.float64)
    except ValueError as error:
        raise document.fail(f"<{element.tag}>: expected numbers: {error}") from error
    if not np.isfinite(values).all():
        raise document.fail(f"<{element.tag}>: expected finite numbers, found NaN or infinity")
    return values
