"""Point clouds as messages, and bags of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.core import Array


@dataclass
class Field:
    name: str
    offset: int
    datatype: int
    count: int = 1


@dataclass
class Cloud:
    height: int
    width: int
    fields: list[Field]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: NDArray[np.uint8]


CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


def cloud_of(order: str = "<", height: int = 1, padding: int = 0, **columns: Array) -> Cloud:
    """A message with these columns; their types are kept."""
    record = np.dtype([(name, order + c.dtype.str[1:]) for name, c in columns.items()])
    table = np.empty(len(columns["x"]), dtype=record)
    for name, column in columns.items():
        table[name] = column
    fields = [Field(n, record.fields[n][1], CODES[c.dtype.str[1:]]) for n, c in columns.items()]
    width = len(table) // height
    rows = np.frombuffer(table.tobytes(), np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return Cloud(height, width, fields, order == ">", record.itemsize, rows.shape[1], rows.ravel())


def ring_of_points(n: int = 360, elevation: float = 0.1) -> dict[str, Array]:
    """A clockwise turn at 3 m, from behind."""
    azimuth = np.pi - 2.0 * np.pi * np.arange(n) / n
    level = 3.0 * np.cos(elevation)
    xyz = level * np.cos(azimuth), level * np.sin(azimuth), np.full(n, 3.0 * np.sin(elevation))
    return dict(zip("xyz", (c.astype(np.float32) for c in xyz), strict=True))


SECONDS = np.linspace(0.0, 0.0999, 360)


@dataclass
class Bag:
    """What a bag is made of: (topic, stamp, message) of clouds and of poses (4, 4)."""

    clouds: list[tuple[str, float, Cloud]]
    odometry: list[tuple[str, float, Array]] = field(default_factory=list)
    poses: list[tuple[str, float, Array]] = field(default_factory=list)

    def write(self, path: Path, kind: str) -> Path:
        """kind: ros1, sqlite3 or mcap. Returns what to open."""
        rosbag1 = pytest.importorskip("rosbags.rosbag1")
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        ros1 = kind == "ros1"
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        path = path.with_suffix(".bag") if ros1 else path
        plugins = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}
        writer = (
            rosbag1.Writer(path) if ros1 else Writer(path, version=9, storage_plugin=plugins[kind])
        )
        serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
        with writer:
            links = {}
            for topic, stamp, message in self._messages(store, ros1):
                name = message.__msgtype__
                if topic not in links:
                    links[topic] = writer.add_connection(topic, name, typestore=store)
                writer.write(links[topic], round(stamp * 1e9), serialize(message, name))
        return path

    def _messages(self, store: object, ros1: bool) -> list[tuple[str, float, object]]:
        types = store.types
        header = {"seq": 0} if ros1 else {}

        def head(stamp: float) -> object:
            time = types["builtin_interfaces/msg/Time"](int(stamp), round(stamp % 1 * 1e9))
            return types["std_msgs/msg/Header"](stamp=time, frame_id="lidar", **header)

        def posed(T: Array) -> object:
            from slam.core import quaternion_xyzw

            point = types["geometry_msgs/msg/Point"](*T[:3, 3])
            turn = types["geometry_msgs/msg/Quaternion"](*quaternion_xyzw(T[:3, :3]))
            return types["geometry_msgs/msg/Pose"](point, turn)

        out: list[tuple[str, float, object]] = []
        for topic, stamp, c in self.clouds:
            fields = [
                types["sensor_msgs/msg/PointField"](f.name, f.offset, f.datatype, f.count)
                for f in c.fields
            ]
            shape = (c.is_bigendian, c.point_step, c.row_step, c.data, True)
            message = types["sensor_msgs/msg/PointCloud2"](
                head(stamp), c.height, c.width, fields, *shape
            )
            out.append((topic, stamp, message))
        for topic, stamp, T in self.poses:
            out.append(
                (topic, stamp, types["geometry_msgs/msg/PoseStamped"](head(stamp), posed(T)))
            )
        for topic, stamp, T in self.odometry:
            zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            twist = types["geometry_msgs/msg/Twist"](zero, zero)
            spread = np.zeros(36)
            message = types["nav_msgs/msg/Odometry"](
                head(stamp),
                "base",
                types["geometry_msgs/msg/PoseWithCovariance"](posed(T), spread),
                types["geometry_msgs/msg/TwistWithCovariance"](twist, spread),
            )
            out.append((topic, stamp, message))
        return sorted(out, key=lambda item: item[1])


def timed_cloud(shift: float = 0.0) -> Cloud:
    columns = ring_of_points()
    columns["x"] = columns["x"] + np.float32(shift)
    ring = np.full(360, 9, dtype=np.uint16)
    return cloud_of(**columns, ring=ring, time=(SECONDS - 0.1).astype(np.float32))


def drive(n: int = 5) -> list[tuple[str, float, Cloud]]:
    return [("/points", 100.0 + 0.1 * i, timed_cloud(0.01 * i)) for i in range(n)]


def shifted(x: float) -> Array:
    T = np.eye(4)
    T[0, 3] = x
    return T
