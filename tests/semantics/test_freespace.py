"""Free space of a closed box of known size: distances, diagram, places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from semantics.freespace.gvd import GvdConfig, gvd_of
from semantics.freespace.places import Places, PlacesConfig, _Merging, components, places_of
from semantics.freespace.space import FreeSpace, Rhythm
from semantics.freespace.tsdf import Tsdf, TsdfConfig, Volume
from semantics.hydra.detector import HydraDetector
from semantics.storeys import by_storey
from slam.core import Keyframe, KeyframeScan, MapPlane, MapView, so3_exp


def box_scan(size: tuple[float, float], at: tuple[float, float]) -> np.ndarray:
    """Returns of a 16-beam sensor at ``at`` in a room [0, size] without floor and ceiling."""
    azimuth = np.repeat(np.deg2rad(np.arange(0.1, 360.0, 0.5)), 16)
    elevation = np.tile(np.deg2rad(np.arange(-15.0, 16.0, 2.0)), 720)
    level = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    with np.errstate(divide="ignore"):
        to_high = (np.array(size) - at) / level
        to_low = -np.array(at) / level
    reach = np.where(level > 0, to_high, to_low).min(axis=1)
    return reach[:, None] * np.column_stack([level, np.tan(elevation)])


def pose(x: float, y: float, yaw: float = 0.0) -> np.ndarray:
    T = np.eye(4)
    T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    T[:2, 3] = x, y
    return T


def test_distances_along_the_rays() -> None:
    tsdf = Tsdf(TsdfConfig(voxel=0.1, truncation=0.3, coarser=1))
    tsdf.integrate(pose(2.0, 1.5), box_scan((4.0, 3.0), (2.0, 1.5)))
    volume = tsdf.volume()
    at = np.rint(
        (np.array([[3.95, 1.5, 0.0], [3.8, 1.5, 0.0], [3.0, 1.5, 0.0]]) - volume.low) / 0.1
    )
    index = tuple(at.astype(int).T)
    assert volume.observed[index].all()
    expected = 4.0 - (volume.low[0] + index[0] * 0.1)
    assert_allclose(volume.distance[index], np.minimum(expected, 0.3), atol=0.02)


def test_behind_the_wall_nothing_is_seen() -> None:
    tsdf = Tsdf(TsdfConfig(coarser=1))
    tsdf.integrate(pose(2.0, 1.5), box_scan((4.0, 3.0), (2.0, 1.5)))
    volume = tsdf.volume()
    x = volume.low[0] + np.arange(volume.distance.shape[0]) * volume.voxel
    assert not volume.observed[x > 4.45].any()


@pytest.mark.parametrize("yaw", [0.0, 0.7, np.pi])
def test_the_heading_of_the_sensor_does_not_matter(yaw: float) -> None:
    points = box_scan((4.0, 3.0), (2.0, 1.5))
    plain, turned = Tsdf(), Tsdf()
    plain.integrate(pose(2.0, 1.5), points)
    turned.integrate(pose(2.0, 1.5, yaw), points @ pose(0, 0, yaw)[:3, :3])
    a, b = plain.volume(), turned.volume()
    assert_allclose(a.low, b.low)
    both = a.observed & b.observed
    assert both.sum() > 0.95 * a.observed.sum()
    assert np.abs(a.distance - b.distance)[both].mean() < 0.02


def test_the_grid_grows_without_losing_what_it_held() -> None:
    near = Tsdf()
    near.integrate(pose(2.0, 1.5), box_scan((4.0, 3.0), (2.0, 1.5)))
    before = near.volume()
    near.integrate(pose(30.0, -20.0), box_scan((4.0, 3.0), (2.0, 1.5)))
    after = near.volume()
    shift = np.rint((before.low - after.low) / before.voxel).astype(int)
    part = tuple(slice(s, s + n) for s, n in zip(shift, before.distance.shape, strict=True))
    assert_allclose(after.distance[part], before.distance, atol=1e-6)


def test_a_scan_without_returns_changes_nothing() -> None:
    tsdf = Tsdf()
    tsdf.integrate(np.eye(4), np.zeros((0, 3)))
    assert tsdf.volume().distance.size == 0


def hall(length: float, width: float) -> Volume:
    """A straight hall along x, walls at y = 0 and y = width, open above and below."""
    voxel = 0.2
    x = np.arange(0.0, length, voxel)
    y = np.arange(-0.2, width + 0.3, voxel)
    z = np.arange(0.0, 1.0, voxel)
    distance = np.minimum(y, width - y)
    shape = len(x), len(y), len(z)
    field = np.broadcast_to(np.clip(distance, -0.3, 0.3)[None, :, None], shape)
    low = np.array([x[0], y[0], z[0]])
    return Volume(field.astype(np.float32), np.ones(shape, bool), low, voxel)


def test_the_diagram_of_a_hall_is_its_middle() -> None:
    volume = hall(10.0, 4.0)
    gvd = gvd_of(volume, GvdConfig(parents_apart=10))
    middle = volume.low[1] + gvd.voxels[:, 1] * volume.voxel
    assert len(middle)
    assert np.abs(middle - 2.0).max() <= 0.2
    assert_allclose(gvd.clearance.max(), 2.0, atol=0.25)


def test_places_of_a_hall_are_a_chain() -> None:
    volume = hall(12.0, 4.0)
    config = PlacesConfig(compression=1.0, merge=0.3)
    places = places_of(gvd_of(volume, GvdConfig(parents_apart=10)), volume, config)
    assert len(places) >= 10
    assert len(set(components(len(places), places.edges).tolist())) == 1
    assert (places.widths <= places.clearance[places.edges].min(axis=1) + 1e-9).all()


def test_free_space_is_integrated_anew_when_the_map_moves() -> None:
    scan = KeyframeScan((), box_scan((6.0, 5.0), (3.0, 2.5)), np.zeros(3))
    space, moved = FreeSpace(), FreeSpace()
    space.add(MapView(0.0, (), [Keyframe(0, 0, 0.0, pose(20.0, 0.0), scan)]))
    view = MapView(1.0, (), [Keyframe(0, 0, 0.0, pose(0.0, 0.0), scan)])
    space.add(view)
    moved.add(view)
    assert_allclose(space.places().positions, moved.places().positions)


def test_what_was_not_observed_around_it_changes_nothing() -> None:
    whole = hall(8.0, 4.0)
    wide = Volume(
        *(np.pad(part, ((3, 5), (2, 1), (4, 0))) for part in (whole.distance, whole.observed)),
        whole.low - whole.voxel * np.array([3, 2, 4]),
        whole.voxel,
    )
    part = wide.observed_part()
    assert part.distance.shape == whole.observed_part().distance.shape
    assert part.observed.sum() == whole.observed.sum()
    config = GvdConfig(parents_apart=10)
    a, b = (places_of(gvd_of(v, config), v, PlacesConfig(1.0)) for v in (wide, part))
    assert len(a) > 0
    assert_allclose(a.positions, b.positions)
    assert_allclose(a.widths, b.widths)
    nothing = Volume(whole.distance, np.zeros_like(whole.observed), whole.low, whole.voxel)
    assert nothing.observed_part() is nothing


def every_column(x, y, *_):
    across, along = (c.ravel() for c in np.broadcast_arrays(x[:, None], y[None, :]))
    return np.arange(len(across)), (across, along)


def walls() -> KeyframeScan:
    points = box_scan((4.0, 3.0), (2.0, 1.5)).astype(np.float32)
    return KeyframeScan((), points, np.zeros(3))


def keyframe(id: int) -> Keyframe:
    scan = KeyframeScan((), np.zeros((0, 3), np.float32), np.zeros(3))
    return Keyframe(id, id, float(id), np.eye(4), scan)


def test_free_space_is_read_by_the_clock_and_for_the_last_word() -> None:
    rhythm, seen = Rhythm(10.0), [keyframe(0)]
    assert rhythm.due(MapView(0.0, (), seen), True)
    seen = [*seen, keyframe(1)]
    assert not rhythm.due(MapView(4.0, (), seen), True)
    assert rhythm.due(MapView(4.3, (), seen), True)  # no keyframe has come: this is the last word
    assert not rhythm.due(MapView(4.4, (), seen), False)  # nothing new to read
    assert rhythm.due(MapView(4.5, (), seen), True)  # the map has moved
    seen = [*seen, keyframe(2)]
    assert not rhythm.due(MapView(14.4, (), seen), True)
    assert rhythm.due(MapView(14.5, (), seen), True)


def test_the_last_word_on_every_storey_is_on_the_map_as_it_is_then() -> None:
    class Seeing(FreeSpace):
        """Tells where the keyframes were when it was read."""

        def places(self) -> Places:
            super().places()
            read.append([float(at[0]) for at in self._used.values()])
            return Places(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2), np.int64), np.zeros(0))

    read: list[list[float]] = []
    detector = by_storey(lambda: HydraDetector(space=Seeing()))
    drive = [replace(keyframe(k), storey=k // 2, scan=walls()) for k in range(4)]
    none = np.zeros(0, np.int64)
    upstairs = MapPlane(0, np.array([1.0, 0, 0]), 0.0, np.zeros((0, 3)), none, none, storey=1)
    for count in range(1, 5):
        detector.update(MapView(3.0 * count, (upstairs,), drive[:count]))
    read.clear()
    moved = [replace(k, T_map_base=pose(1.0, 0.0)) for k in drive]
    detector.update(MapView(12.3, (upstairs,), moved))
    assert read == [[1.0, 1.0], [1.0, 1.0]]


@pytest.mark.parametrize("tilt", [0.0, 0.1, 0.3])
def test_columns_behind_all_returns_would_have_added_nothing(
    tilt: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = box_scan((9.0, 4.0), (2.0, 1.0))
    scan = scan[np.hypot(scan[:, 0], scan[:, 1]) > 1.2]  # a sector without returns
    turned = pose(0.0, 0.0, 0.7)
    turned[:3, :3] = turned[:3, :3] @ so3_exp(np.array([tilt, -0.5 * tilt, 0.0]))
    culled, whole = Tsdf(), Tsdf()
    culled.integrate(turned, scan)
    monkeypatch.setattr("semantics.freespace.tsdf._columns", every_column)
    whole.integrate(turned, scan)
    assert_array_equal(culled._weight, whole._weight)
    assert_array_equal(culled._distance, whole._distance)


@pytest.mark.parametrize(("by_basis", "kept"), [(False, 1.0), (True, 0.5)])
def test_of_two_near_places_one_stays(by_basis: bool, kept: float) -> None:
    positions = np.array([[0.0, 0, 0], [0.3, 0, 0], [3.0, 0, 0]])
    config = PlacesConfig(merge_by_basis=by_basis)
    merging = _Merging(
        positions,
        np.array([1.0, 0.5, 0.8]),
        np.array([2, 3, 2]),
        np.array([[0, 1], [1, 2]]),
        np.array([0.5, 0.5]),
        config,
    )
    assert sorted(merging.places().clearance.tolist()) == sorted([kept, 0.8])
