"""Real recordings as input: whatever file it is, scans come out."""

from __future__ import annotations

from pathlib import Path

from eval.recordings.recording import Recording, RecordingOptions, poses_at
from slam.core import InputError

__all__ = ["Recording", "RecordingOptions", "is_recording", "open_recording", "poses_at"]

SUFFIXES = (".pcap", ".bin", ".bag", ".db3", ".mcap")


def open_recording(path: Path | str, options: RecordingOptions | None = None) -> Recording:
    """A VLP-16 capture (.pcap, or its packets alone as .bin) or a ROS bag (.bag, .db3, .mcap, or a
    folder with one), told apart by what is in it.

    Raises InputError for anything else, and for a recording without scans.
    """
    path, options = Path(path), options or RecordingOptions()
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if _is_bag(path):
        from eval.recordings.bags import BagRecording

        return BagRecording(path, options)
    from eval.recordings.packets import PacketRecording, holds_packets

    if holds_packets(path):
        return PacketRecording(path, options)
    raise InputError(
        f"{path}: not a recording: expected a pcap, VLP-16 packets or a ROS bag"
        f" ({', '.join(SUFFIXES)} or a folder)"
    )


def is_recording(path: Path | str) -> bool:
    """Whether a path names a recording rather than a plan, a mesh or a scenario."""
    path = Path(path)
    return path.suffix.lower() in SUFFIXES or (path.is_dir() and _is_bag(path))


def _is_bag(path: Path) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or any(path.glob("*.bag"))
    return path.suffix.lower() in (".bag", ".db3", ".mcap")
