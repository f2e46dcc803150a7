"""A drive as a ROS 2 bag that any ROS 2 mapping system can play."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from eval.files import claim_new
from slam.core import Array, InputError, Scan, WheelOdometry, quaternion_xyzw

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

WORLD, ODOM, BASE, LIDAR = "world", "odom", "base_link", "lidar"
"""Frames."""

POINT = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),
        ("ring", "<u2"),
        ("time", "<f4"),
    ]
)
"""As the driver of a VLP-16 lays out a point, without its padding."""
FLOAT32, UINT16 = 7, 4
"""PointField.datatype."""
FIELDS = tuple(
    (name, 4 * place - 2 * (name == "time"), UINT16 if name == "ring" else FLOAT32)
    for place, name in enumerate(POINT.names or ())
)
"""Name, offset and type of each."""

TOPICS = {
    "/points": "sensor_msgs/msg/PointCloud2",
    "/wheel_odometry": "nav_msgs/msg/Odometry",
    "/ground_truth": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
}
LATCHED = "/tf_static"


class BagWriter:
    """Writes a new folder with a bag; use it as a context manager. Raises InputError.

    A cloud's stamp is its sweep's end; ``time`` counts back from it [s]. /wheel_odometry and /tf
    (odom -> base_link) are the robot's own word, /ground_truth (world -> base_link) the
    simulator's; /tf_static holds where the LiDAR sits.
    """

    def __init__(self, folder: Path) -> None:
        try:
            from rosbags.rosbag2 import StoragePlugin, Writer
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise InputError(
                f"{folder}: writing bags needs rosbags: pip install 'roomloop[ros]'"
            ) from error
        claim_new(folder)
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        self._writer = Writer(folder, version=8, storage_plugin=StoragePlugin.SQLITE3)
        self._messages = _Messages(self._store)
        self._links: dict[str, Any] = {}
        self._mounted = False

    def __enter__(self) -> BagWriter:
        self._writer.open()
        for topic, kind in TOPICS.items():
            self._links[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store, offered_qos_profiles=_qos(topic)
            )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._writer.close()

    def write(self, scan: Scan, T_world_base: Array) -> None:
        """One sweep, with what the wheels and the truth say at its end."""
        make, stamp = self._messages, scan.stamp
        if not self._mounted:
            mounting = make.transforms(stamp, BASE, LIDAR, scan.T_base_lidar)
            self._put("/tf_static", stamp, mounting)
            self._mounted = True
        if scan.wheels is not None:
            wheels = scan.wheels
            self._put("/wheel_odometry", stamp, make.odometry(ODOM, wheels))
            self._put("/tf", stamp, make.transforms(stamp, ODOM, BASE, wheels.T_odom_base))
        truth = WheelOdometry(stamp, T_world_base, np.zeros(6))
        self._put("/ground_truth", stamp, make.odometry(WORLD, truth))
        self._put("/points", stamp, make.cloud(scan))

    def _put(self, topic: str, stamp: float, message: object) -> None:
        data = self._store.serialize_cdr(message, TOPICS[topic])
        self._writer.write(self._links[topic], round(stamp * 1e9), data)


def _qos(topic: str) -> tuple[Any, ...]:
    """Static transforms are kept for who comes late; the rest is as ROS does by default."""
    if topic != LATCHED:
        return ()
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    never = QosTime(0, 0)
    return (
        Qos(
            QosHistory.KEEP_LAST,
            1,
            QosReliability.RELIABLE,
            QosDurability.TRANSIENT_LOCAL,
            never,
            never,
            QosLiveliness.AUTOMATIC,
            never,
            False,
        ),
    )


class _Messages:
    """Makes messages of a type store."""

    def __init__(self, store: Typestore) -> None:
        self._types: Any = store.types

    def cloud(self, scan: Scan) -> object:
        """sensor_msgs/PointCloud2."""
        table = np.zeros(len(scan), dtype=POINT)
        for axis, name in enumerate("xyz"):
            table[name] = scan.points[:, axis]
        table["intensity"], table["ring"], table["time"] = scan.intensity, scan.ring, scan.times
        make = self._types["sensor_msgs/msg/PointField"]
        fields = [make(name, offset, kind, 1) for name, offset, kind in FIELDS]
        return self._types["sensor_msgs/msg/PointCloud2"](
            header=self._header(scan.stamp, LIDAR),
            height=1,
            width=len(table),
            fields=fields,
            is_bigendian=False,
            point_step=POINT.itemsize,
            row_step=POINT.itemsize * len(table),
            data=table.view(np.uint8).reshape(-1),
            is_dense=True,
        )

    def odometry(self, frame: str, odometry: WheelOdometry) -> object:
        """nav_msgs/Odometry of the base in ``frame``; covariances are not known (0)."""
        linear, angular = (
            self._types["geometry_msgs/msg/Vector3"](*part.tolist())
            for part in np.split(odometry.twist, 2)
        )
        pose = self._types["geometry_msgs/msg/Pose"](
            self._types["geometry_msgs/msg/Point"](*odometry.T_odom_base[:3, 3].tolist()),
            self._quaternion(odometry.T_odom_base),
        )
        unknown = np.zeros(36)
        return self._types["nav_msgs/msg/Odometry"](
            self._header(odometry.stamp, frame),
            BASE,
            self._types["geometry_msgs/msg/PoseWithCovariance"](pose, unknown),
            self._types["geometry_msgs/msg/TwistWithCovariance"](
                self._types["geometry_msgs/msg/Twist"](linear, angular), unknown
            ),
        )

    def transforms(self, stamp: float, parent: str, child: str, T_parent_child: Array) -> object:
        """tf2_msgs/TFMessage with one transform."""
        move = self._types["geometry_msgs/msg/Vector3"](*T_parent_child[:3, 3].tolist())
        transform = self._types["geometry_msgs/msg/TransformStamped"](
            self._header(stamp, parent),
            child,
            self._types["geometry_msgs/msg/Transform"](move, self._quaternion(T_parent_child)),
        )
        return self._types["tf2_msgs/msg/TFMessage"]([transform])

    def _quaternion(self, T: Array) -> object:
        return self._types["geometry_msgs/msg/Quaternion"](*quaternion_xyzw(T[:3, :3]).tolist())

    def _header(self, stamp: float, frame: str) -> object:
        seconds, nanoseconds = divmod(round(stamp * 1e9), 1_000_000_000)
        time = self._types["builtin_interfaces/msg/Time"](seconds, nanoseconds)
        return self._types["std_msgs/msg/Header"](stamp=time, frame_id=frame)
