"""Triangles of a mesh file in metres, z up."""

from __future__ import annotations

import io
import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slam.core import Array, InputError, IntArray
from worlds.readers.collada import Triangles, read_collada
from worlds.readers.formats import format_of
from worlds.readers.glbfile import check_glb
from worlds.readers.options import ReaderOptions
from worlds.readers.units import scale_to_metres, size_text

MAX_TRIANGLES = 2_000_000
"""Most triangles that a building is made of."""
UNIT_FIELD = {"COLLADA": "asset/unit", "GLB": "scene"}
"""Where a file would declare its unit; the other formats cannot."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Mesh:
    """vertices: (V, 3) [m], z up, all in use; faces: (T, 3)."""

    vertices: Array
    faces: IntArray


def read_triangles(path: Path, options: ReaderOptions) -> Mesh:
    """The triangles of a mesh file. Raises InputError for what is broken, empty, not finite, too
    large, or of a size that no building has."""
    kind = format_of(path).name
    read = read_collada(path, MAX_TRIANGLES) if kind == "COLLADA" else None
    raw = read or _through_trimesh(path, kind.lower())
    if not len(raw.faces):
        raise InputError(f"{path}: expected triangles, found none")
    if raw.faces.min() < 0 or raw.faces.max() >= len(raw.vertices):
        raise InputError(f"{path}: expected triangles of its {len(raw.vertices)} vertices")
    used, index = np.unique(raw.faces, return_inverse=True)
    raw = replace(raw, vertices=raw.vertices[used], faces=index.reshape(-1, 3))
    if not np.isfinite(raw.vertices).all():
        raise InputError(f"{path}: expected finite coordinates, found NaN or infinity")
    raw = replace(raw, vertices=_z_up(path, raw, options))
    extent = np.ptp(raw.vertices, axis=0)
    scale = scale_to_metres(
        path, extent, raw.unit, options.unit, UNIT_FIELD.get(kind, "a unit of length")
    )
    return Mesh(raw.vertices * scale, raw.faces)


def _z_up(path: Path, raw: Triangles, options: ReaderOptions) -> Array:
    up = options.up or raw.up
    if up is None:
        _doubt(path, raw.vertices)
    x, y, z = raw.vertices.T
    return np.column_stack([x, -z, y]) if up == "y" else raw.vertices


def _doubt(path: Path, vertices: Array) -> None:
    """Buildings are flat: says so where z, taken for up, is not the shortest side but y is."""
    extent = np.ptp(vertices, axis=0)
    if np.argmin(extent) == 1 and extent[1] < 0.7 * extent[2]:
        log.warning(
            "%s: no up axis declared, taken as z up: %s; with y up it would be flatter",
            path,
            size_text(extent),
        )


# --- OBJ, STL, PLY, GLB --------------------------------------------------------------------------


def _through_trimesh(path: Path, suffix: str) -> Triangles:
    """The triangles as trimesh reads them; textures and files that it refers to are not opened."""
    import trimesh

    content = path.read_bytes()
    if suffix == "glb":
        check_glb(content, path)
    data = io.BytesIO(content)
    try:
        if suffix == "obj":
            scene = trimesh.load_scene(data, suffix, process=False, skip_materials=True)
        else:
            scene = trimesh.load_scene(data, suffix, process=False)
        return _flattened(path, scene, suffix)
    except InputError:
        raise
    except MemoryError as error:
        raise InputError(f"{path}: expected a mesh that fits into memory") from error
    except Exception as error:
        # Whatever a foreign parser stumbles over in a broken file is the file's fault.
        reason = str(error).splitlines()[0][:120] if str(error) else "its parts do not fit"
        raise InputError(f"{path}: expected {suffix.upper()}: {reason}") from error


def _flattened(path: Path, scene: object, suffix: str) -> Triangles:
    import trimesh

    assert isinstance(scene, trimesh.Scene)
    placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
    shapes = [(T, scene.geometry[name]) for T, name in placed if name is not None]
    meshes = [(T, shape) for T, shape in shapes if isinstance(shape, trimesh.Trimesh)]
    count = sum(len(mesh.faces) for _, mesh in meshes)
    if count > MAX_TRIANGLES:
        raise InputError(f"{path}: {count} triangles, expected at most {MAX_TRIANGLES}")
    vertices = [trimesh.transform_points(mesh.vertices, T) for T, mesh in meshes]
    sizes = np.cumsum([0, *(len(v) for v in vertices)])
    faces = [np.asarray(m.faces) + n for (_, m), n in zip(meshes, sizes, strict=False)]
    declared = (1.0, "y") if suffix == "glb" else (None, None)  # the standard says so
    return Triangles(
        np.concatenate([np.empty((0, 3)), *vertices]),
        np.concatenate([np.empty((0, 3), np.int64), *faces]),
        *declared,
    )
