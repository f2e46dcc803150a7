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


IFC_WALLS = {
    "south": ((-0.1, -0.1), (8.1, 0.1)),
    "north": ((-0.1, 4.9), (8.1, 5.1)),
    "west": ((-0.1, 0.1), (0.1, 4.9)),
    "east": ((7.9, 0.1), (8.1, 4.9)),
    "middle": ((4.9, 0.1), (5.1, 4.9)),
}


class IfcFile:
    """An IFC4 file under construction: the building, unless told otherwise."""

    def __init__(self, unit: dict[str, object] | None = None, floors: tuple[float, ...] = (0.0,)):
        import ifcopenshell
        import ifcopenshell.api.aggregate
        import ifcopenshell.api.context
        import ifcopenshell.api.root
        import ifcopenshell.api.unit

        self.model = model = ifcopenshell.file(schema="IFC4")
        self.api = ifcopenshell.api
        project = self._entity("IfcProject")
        if unit is not None:
            ifcopenshell.api.unit.assign_unit(model, **unit)
        top = ifcopenshell.api.context.add_context(model, "Model")
        self.context = ifcopenshell.api.context.add_context(
            model, "Model", "Body", "MODEL_VIEW", parent=top
        )
        self.building = self._entity("IfcBuilding")
        ifcopenshell.api.aggregate.assign_object(model, [self.building], project)
        self.walls: dict[tuple[str, float], object] = {}
        self.storeys = {z: self._storey(z) for z in floors}

    def _entity(self, kind: str, name: str = "x") -> object:
        return self.api.root.create_entity(self.model, kind, name=name)

    def _storey(self, z: float) -> object:
        storey = self._entity("IfcBuildingStorey", f"level {z:g}")
        self.api.aggregate.assign_object(self.model, [storey], self.building)
        return storey

    def box(self, kind: str, name: str, plan: tuple, z: tuple[float, float], scale: float = 1.0):
        """An entity in the shape of a box."""
        import ifcopenshell.api.geometry

        (x0, y0), (x1, y1) = np.asarray(plan) * scale
        low, high = np.asarray(z) * scale
        model, entity = self.model, self._entity(kind, name)
        ring = [model.createIfcCartesianPoint(p) for p in [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]]
        profile = model.createIfcArbitraryClosedProfileDef(
            "AREA", None, model.createIfcPolyline([*ring, ring[0]])
        )
        origin = model.createIfcAxis2Placement3D(model.createIfcCartesianPoint((0.0, 0.0, low)))
        up = model.createIfcDirection((0.0, 0.0, 1.0))
        solid = model.createIfcExtrudedAreaSolid(profile, origin, up, high - low)
        shape = model.createIfcShapeRepresentation(self.context, "Body", "SweptSolid", [solid])
        ifcopenshell.api.geometry.assign_representation(model, entity, shape)
        ifcopenshell.api.geometry.edit_object_placement(model, entity)
        return entity

    def wall(self, name: str, z: float = 0.0, height: float = HEIGHT, scale: float = 1.0) -> None:
        """One of ``IFC_WALLS``, standing on a floor."""
        import ifcopenshell.api.spatial

        wall = self.box("IfcWall", name, IFC_WALLS[name], (z, z + height), scale)
        ifcopenshell.api.spatial.assign_container(self.model, [wall], self.storeys[z])
        self.walls[name, z] = wall

    def hole(self, kind: str, shape: shapely.Polygon, wall: str, z: tuple, scale: float = 1.0):
        """An opening in a wall, filled with a door or window (or with nothing)."""
        import ifcopenshell.api.feature

        x0, y0, x1, y1 = shape.bounds
        plan = ((x0, y0), (x1, y1))
        opening = self.box("IfcOpeningElement", kind, plan, z, scale)
        floor = next(z for name, z in self.walls if name == wall)
        ifcopenshell.api.feature.add_feature(self.model, opening, self.walls[wall, floor])
        if kind != "nothing":
            filling = self.box(kind, kind, plan, z, scale)
            ifcopenshell.api.feature.add_filling(self.model, opening, filling)

    def space(self, name: str, shape: shapely.Polygon, z: float = 0.0, scale: float = 1.0) -> None:
        """A room."""
        x0, y0, x1, y1 = shape.bounds
        space = self.box("IfcSpace", name, ((x0, y0), (x1, y1)), (z, z + HEIGHT), scale)
        self.api.aggregate.assign_object(self.model, [space], self.storeys[z])

    def furnish(self, spaces: bool = True, scale: float = 1.0) -> IfcFile:
        """The building's walls, door, window and spaces on every storey."""
        for z in self.storeys:
            for name in IFC_WALLS:
                self.wall(name, z, scale=scale)
            if spaces:
                self.space("office", LEFT, z, scale)
                self.space("corridor", RIGHT, z, scale)
        self.hole("IfcDoor", DOOR, "middle", (0.0, 2.1), scale)
        self.hole("IfcWindow", WINDOW, "south", (0.9, 2.0), scale)
        return self

    def saved(self, folder: Path) -> Path:
        """The file."""
        path = folder / "building.ifc"
        self.model.write(str(path))
        return path


def ifc(folder: Path, spaces: bool = True) -> Path:
    """The building as IFC, in metres."""
    return IfcFile({"length": {"is_metric": True, "raw": "METERS"}}).furnish(spaces).saved(folder)


def rosmap(folder: Path, image: np.ndarray, resolution: float = 0.05, **more: object) -> Path:
    """An occupancy map: the yaml, and its image beside it."""
    import yaml
    from PIL import Image

    Image.fromarray(image).save(folder / "floor.pgm")
    head = {"image": "floor.pgm", "resolution": resolution, "origin": [-1.0, -1.0, 0.0]}
    path = folder / "floor.yaml"
    path.write_text(yaml.safe_dump(head | {"negate": 0} | more))
    return path


def drawn_map(walls: shapely.Polygon = WALLS, resolution: float = 0.05) -> np.ndarray:
    """The building as pixels: 0 occupied, 254 free inside, 205 unknown outside."""
    x = -1.0 + resolution * (np.arange(round(10.0 / resolution)) + 0.5)
    y = -1.0 + resolution * (np.arange(round(7.0 / resolution)) + 0.5)
    inside = shapely.contains_xy(OUTSIDE, *np.meshgrid(x, y[::-1]))
    solid = shapely.contains_xy(walls, *np.meshgrid(x, y[::-1]))
    return np.where(solid, 0, np.where(inside, 254, 205)).astype(np.uint8)
