"""ROS 1 and ROS 2 bags as recordings, through ``rosbags``: no ROS is needed."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard, cast

import numpy as np

from eval.recordings.clouds import BadCloud, PointCloud2, read_cloud, scan_of
from eval.recordings.recording import RecordingOptions, is_tum, truth_beside
from eval.score.trajectory import Trajectory
from slam.core import (
    Array,
    InputError,
    Scan,
    WheelOdometry,
    pose,
    rotation_from_quaternion_xyzw,
)
from slam.plainfile import size_of

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

logger = logging.getLogger(__name__)

CLOUDS = "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
TF = "tf2_msgs/msg/TFMessage"
WHEELS = "wheel"
"""What the name of a wheel odometry's topic says."""
TRUTH_WORDS = ("truth", "mocap", "vicon", "optitrack")
"""What the name of a truth topic says. Any other odometry may be the robot's own estimate."""

PERIOD = 0.1
"""Of a sweep [s], where a cloud has no times and there was none before it."""
MAGIC = {".bag": b"#ROSBAG V2.0", ".db3": b"SQLite format 3\0", ".mcap": b"\x89MCAP0\r\n"}


class Stamp(Protocol):
    """builtin_interfaces/Time."""

    sec: int
    nanosec: int


class Header(Protocol):
    """std_msgs/Header."""

    stamp: Stamp
    frame_id: str


class Vector(Protocol):
    """geometry_msgs/Point; Quaternion has a w, too."""

    x: float
    y: float
    z: float
    w: float


class Pose(Protocol):
    """geometry_msgs/Pose."""

    position: Vector
    orientation: Vector


class Message(Protocol):
    """Any message that is read here; only the pose ones have a pose, an Odometry a twist."""

    header: Header
    pose: Pose
    twist: Any


class BagRecording:
    """The scans of one PointCloud2 topic.

    Where the sensor sits on its base is taken from the bag's static transforms, if its parent there
    is a base; wheel odometry with a scan's own stamp comes with the scan. Raises InputError where
    there are no point clouds, or several topics of them and no choice.
    """

    def __init__(self, path: Path, options: RecordingOptions = RecordingOptions()) -> None:  # noqa: B008
        self.path = path
        self.skipped = 0
        with _opened(path) as bag:
            self.topic = _cloud_topic(path, bag, options.topic)
            self.count: int | None = bag.topics[self.topic].msgcount
            self.duration: float | None = max(bag.end_time - bag.start_time, 0) * 1e-9
            self.truth = truth_beside(path, options)
            if self.truth is None:
                self.truth = _truth(path, bag, options.truth)
            T_base_lidar = options.T_base_lidar
            self._T_base_lidar = (
                _mounting(path, bag, self.topic) if T_base_lidar is None else T_base_lidar
            )
            self._wheels = _wheels(bag)

    def __iter__(self) -> Iterator[Scan]:
        self.skipped = 0
        index, last, reason = 0, -np.inf, "it holds no messages"
        for scan in self._scans():
            if isinstance(scan, Scan) and scan.stamp <= last:
                scan = BadCloud(f"its stamp {scan.stamp:.6f} s does not come after {last:.6f} s")
            if isinstance(scan, BadCloud):
                self.skipped, reason = self.skipped + 1, str(scan)
                logger.warning("%s: scan skipped: %s", self.path, reason)
            else:
                yield replace(scan, index=index)
                index, last = index + 1, scan.stamp
        if index == 0:
            raise InputError(f"{self.path}: no good scan in {self.topic}: {reason}")

    def _scans(self) -> Iterator[Scan | BadCloud]:
        """Scans, and in place of bad ones what is wrong with them."""
        previous = None
        with _opened(self.path) as bag:
            for message, stamp in _messages(bag, self.topic):
                if isinstance(message, BadCloud):
                    yield message
                    continue
                period = PERIOD if previous is None else float(np.clip(stamp - previous, 0.02, 0.5))
                try:
                    cloud = read_cloud(cast("PointCloud2", message))
                    if previous is None:
                        self._say_what_is_missing(cloud.seconds is None, cloud.ring is None)
                    previous = stamp
                    scan = scan_of(cloud, 0, stamp, period, self._T_base_lidar)
                    yield replace(scan, wheels=self._wheels.get(scan.stamp))
                except BadCloud as bad:
                    yield bad

    def _say_what_is_missing(self, times: bool, rings: bool) -> None:
        if times:
            logger.warning("%s: points without times: spread evenly by azimuth", self.path)
        if rings:
            logger.warning("%s: points without rings: told apart by elevation", self.path)


@contextmanager
def _opened(path: Path) -> Iterator[AnyReader]:
    """A bag to read from. Raises InputError for what cannot be one."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(
            f"{path}: reading bags needs rosbags: pip install 'roomloop[ros]'"
        ) from error
    files = sorted(path.glob("*.bag")) if path.is_dir() else []
    _check_magic(files if path.is_dir() else [path])
    try:
        bag = AnyReader(files or [path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        bag.open()
    # A foreign or damaged file makes the reader's parsers fail in many ways; all mean the same.
    except Exception as error:
        raise InputError(f"{path}: not a readable bag: {_line(error)}") from error
    try:
        yield bag
    finally:
        bag.close()


def _check_magic(files: Sequence[Path]) -> None:
    for file in files:
        magic = MAGIC.get(file.suffix, b"")
        size_of(file)
        with file.open("rb") as opened:
            if opened.read(len(magic)) != magic:
                raise InputError(f"{file}: not a {file.suffix} file")


def _messages(bag: AnyReader, topic: str) -> Iterator[tuple[Message | BadCloud, float]]:
    """Messages of a topic with their header's stamp, or when they were logged where it is 0.

    In place of a message that cannot be taken apart, or of all that follows damage: BadCloud.
    """
    connections = [c for c in bag.connections if c.topic == topic]
    stream = bag.messages(connections=connections)
    while True:
        try:
            connection, logged, raw = next(stream)
        except StopIteration:
            return
        except Exception as error:  # as in _opened
            yield BadCloud(f"damaged: read up to there: {_line(error)}"), np.nan
            return
        try:
            message = cast("Message", bag.deserialize(raw, connection.msgtype))
            yield message, _seconds(message.header.stamp) or 1e-9 * logged
        except Exception as error:
            yield BadCloud(f"message cannot be taken apart: {_line(error)}"), np.nan


def _seconds(stamp: Stamp) -> float:
    """To the nearest number that says these nanoseconds."""
    return round(stamp.sec + 1e-9 * stamp.nanosec, 9)


def _line(error: Exception) -> str:
    """An error's text on one line, with its kind where it says nothing."""
    return " ".join(str(error).split()) or type(error).__name__


# --- topics ---------------------------------------------------------------------------------------


def _cloud_topic(path: Path, bag: AnyReader, wanted: str | None) -> str:
    topics = _topics(bag, (CLOUDS,))
    if not topics:
        held = ", ".join(sorted(bag.topics)) or "nothing"
        raise InputError(f"{path}: no sensor_msgs/PointCloud2 topic, it holds {held}")
    if wanted is None and len(topics) > 1:
        raise InputError(f"{path}: several point clouds, choose a topic: {', '.join(topics)}")
    if wanted is not None and wanted not in topics:
        raise InputError(f"{path}: topic {wanted}: expected one of {', '.join(topics)}")
    return wanted or topics[0]


def _topics(bag: AnyReader, types: Sequence[str]) -> list[str]:
    return sorted(name for name, info in bag.topics.items() if info.msgtype in types)


def _truth(path: Path, bag: AnyReader, wanted: str | None) -> Trajectory | None:
    """What the bag itself holds of the truth."""
    topics = _topics(bag, (ODOMETRY, POSE))
    if wanted is None:
        named = [name for name in topics if any(word in name.lower() for word in TRUTH_WORDS)]
        return _read_truth(path, bag, named[0]) if len(named) == 1 else None
    if is_tum(wanted):
        return None
    if wanted not in topics:
        raise InputError(
            f"{path}: truth {wanted}: expected a .tum file or one of: {', '.join(topics) or 'none'}"
        )
    return _read_truth(path, bag, wanted)


def _read_truth(path: Path, bag: AnyReader, topic: str) -> Trajectory:
    """Poses as recorded, those left out whose stamp does not come after the one before."""
    stamps: list[float] = []
    poses: list[Array] = []
    for message, stamp in _messages(bag, topic):
        if isinstance(message, BadCloud):
            logger.warning("%s: pose of %s skipped: %s", path, topic, message)
        elif not stamps or stamp > stamps[-1]:
            stamps.append(stamp)
            poses.append(_pose(message))
    if not np.isfinite(poses).all():
        raise InputError(f"{path}: truth {topic}: a pose is not finite")
    return Trajectory(np.array(stamps), np.array(poses).reshape(-1, 4, 4))


def _pose(message: Message) -> Array:
    """(4, 4) of a PoseStamped or an Odometry."""
    inner = getattr(message.pose, "pose", message.pose)
    return _rigid(inner.orientation, inner.position)


def _rigid(q: Vector, t: Vector) -> Array:
    rotation = rotation_from_quaternion_xyzw(np.array([q.x, q.y, q.z, q.w]))
    return pose(rotation, np.array([t.x, t.y, t.z]))


# --- the robot ------------------------------------------------------------------------------------


def _mounting(path: Path, bag: AnyReader, topic: str) -> Array:
    """T_base_lidar by the static transforms; identity where none leads from a base to the cloud."""
    frame = next((m.header.frame_id for m, _ in _messages(bag, topic) if _is_message(m)), None)
    for link in _static_links(path, bag):
        if link.child_frame_id == frame and "base" in link.header.frame_id:
            T_base_lidar = _rigid(link.transform.rotation, link.transform.translation)
            if not np.isfinite(T_base_lidar).all():
                raise InputError(f"{path}: /tf_static: the sensor's place is not finite")
            return T_base_lidar
    return np.eye(4)


def _static_links(path: Path, bag: AnyReader) -> Iterator[Any]:
    static = [c for c in bag.connections if c.topic == "/tf_static" and c.msgtype == TF]
    try:
        for connection, _, raw in bag.messages(connections=static) if static else ():
            message: Any = bag.deserialize(raw, connection.msgtype)
            yield from message.transforms
    except Exception as error:  # as in _opened
        raise InputError(f"{path}: /tf_static: cannot be taken apart: {_line(error)}") from error


def _is_message(message: Message | BadCloud) -> TypeGuard[Message]:
    return not isinstance(message, BadCloud)


def _wheels(bag: AnyReader) -> dict[float, WheelOdometry]:
    """Wheel odometry by its stamps; empty unless one topic is named so."""
    topics = [name for name in _topics(bag, (ODOMETRY,)) if WHEELS in name.lower()]
    if len(topics) != 1:
        return {}
    readings = ((m, stamp) for m, stamp in _messages(bag, topics[0]) if _is_message(m))
    return {stamp: WheelOdometry(stamp, _pose(m), _twist(m)) for m, stamp in readings}


def _twist(message: Message) -> Array:
    """(6,) of an Odometry."""
    twist = message.twist.twist
    vectors = (twist.linear, twist.angular)
    return np.array([getattr(vector, axis) for vector in vectors for axis in "xyz"])
