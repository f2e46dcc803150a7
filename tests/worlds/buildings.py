"""One small building in many file formats: two rooms, a door, a window, all of it known.

Outside 8.2 x 5.2 m, walls 0.2 m; between the rooms, at x = 4.9 to 5.1, a door from y = 2 to 2.9 and
2.1 m high; a window in the south wall from x = 1 to 2.5, 0.9 to 2.0 m high; ceiling at 2.6 m.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import shapely
import trimesh
from shapely.geometry import box

HEIGHT = 2.6
OUTSIDE = box(-0.1, -0.1, 8.1, 5.1)
LEFT, RIGHT = box(0.1, 0.1, 4.9, 4.9), box(5.1, 0.1, 7.9, 4.9)
WALLS = OUTSIDE.difference(shapely.union_all([LEFT, RIGHT]))
DOOR = box(4.9, 2.0, 5.1, 2.9)
WINDOW = box(1.0, -0.1, 2.5, 0.1)


def pieces() -> list[trimesh.Trimesh]:
    """The building as closed boxes: walls, lintel, sill, floor and ceiling slab."""
    spans = [
        (-0.1, -0.1, 1.0, 0.1, 0.0, HEIGHT),
        (1.0, -0.1, 2.5, 0.1, 0.0, 0.9),
        (1.0, -0.1, 2.5, 0.1, 2.0, HEIGHT),
        (2.5, -0.1, 8.1, 0.1, 0.0, HEIGHT),
        (-0.1, 4.9, 8.1, 5.1, 0.0, HEIGHT),
        (-0.1, 0.1, 0.1, 4.9, 0.0, HEIGHT),
        (7.9, 0.1, 8.1, 4.9, 0.0, HEIGHT),
        (4.9, 0.1, 5.1, 2.0, 0.0, HEIGHT),
        (4.9, 2.0, 5.1, 2.9, 2.1, HEIGHT),
        (4.9, 2.9, 5.1, 4.9, 0.0, HEIGHT),
        (-0.1, -0.1, 8.1, 5.1, -0.2, 0.0),
        (-0.1, -0.1, 8.1, 5.1, HEIGHT, HEIGHT + 0.2),
    ]
    return [
        trimesh.creation.box(bounds=[[x0, y0, z0], [x1, y1, z1]])
        for x0, y0, x1, y1, z0, z1 in spans
    ]


def building(up: float = 0.0) -> trimesh.Trimesh:
    """The building as one mesh, ``up`` metres higher."""
    mesh = trimesh.util.concatenate(pieces())
    mesh.apply_translation([0.0, 0.0, up])
    return mesh


def y_up(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same in a frame with y up."""
    turned = mesh.copy()
    turned.vertices = turned.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    return turned


def dae(mesh: trimesh.Trimesh, folder: Path, unit: str = "", up: str = "", head: str = "") -> Path:
    """A COLLADA file, its geometry placed by two nested nodes."""
    points = " ".join(f"{v:.6f}" for v in (mesh.vertices - [1.0, 2.0, 3.0]).ravel())
    faces = " ".join(map(str, mesh.faces.ravel()))
    path = folder / "building.dae"
    path.write_text(
        f"""<?xml version="1.0" encoding="utf-8"?>{head}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}{up}</asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="{mesh.vertices.size}">{points}</float_array>
<technique_common><accessor source="#a" count="{len(mesh.vertices)}" stride="3"/></technique_common>
</source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{len(mesh.faces)}"><input semantic="VERTEX" source="#v" offset="0"/>
<p>{faces}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
<node><translate>1 2 0</translate><node><matrix>1 0 0 0 0 1 0 0 0 0 1 3 0 0 0 1</matrix>
<instance_geometry url="#g"/></node></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""
    )
    return path


def as_polygon(shape: shapely.Polygon, factor: float = 1.0) -> dict[str, object]:
    """A polygon of the floor-plan JSON."""
    rings = [np.asarray(r.coords)[:-1] * factor for r in (shape.exterior, *shape.interiors)]
    return {"outer": rings[0].tolist(), "holes": [ring.tolist() for ring in rings[1:]]}


def floorplan(**changes: object) -> dict[str, object]:
    """The floor-plan JSON of the building."""
    storey = {
        "name": "0",
        "z_floor": 0.0,
        "z_ceiling": HEIGHT,
        "rooms": [
            {"id": "l", "name": "OFFICE", "polygons": [as_polygon(LEFT)]},
            {"guid": "r", "name": "CORRIDOR", "polygons": [as_polygon(RIGHT)]},
        ],
        "walls": [{"solid": [as_polygon(WALLS)]}],
        "openings": [
            opening("door", DOOR, 0.0, 2.1),
            opening("window", WINDOW, 0.9, 2.0),
        ],
        "columns": [],
        "furniture": [],
    }
    return {"units": "metre", "source": "test", "storeys": [storey | changes]}


def opening(kind: str, shape: shapely.Polygon, low: float, high: float) -> dict[str, object]:
    """An opening of the floor-plan JSON."""
    ring = np.asarray(shape.exterior.coords)[:-1].tolist()
    return {"kind": kind, "polygon": ring, "z_min": low, "z_max": high}


def saved(tree: object, folder: Path, name: str = "floor.json") -> Path:
    """A file of JSON, or of text as it is."""
    path = folder / name
    path.write_text(tree if isinstance(tree, str) else json.dumps(tree), encoding="utf-8")
    return path
