"""Poses sent together are those that would be sent one by one."""

from __future__ import annotations

from typing import Any

import numpy as np

from eval.view import shapes
from eval.view.poses import Poses
from slam.core import pose, so3_exp


class Stream:
    def __init__(self) -> None:
        self.sent: list[tuple[str, Any, Any]] = []

    def send_columns(self, entity: str, indexes: Any, columns: Any) -> None:
        self.sent.append((entity, indexes, columns))


def test_poses_go_out_together_and_once() -> None:
    stream, poses = Stream(), Poses("robot")
    poses.send(stream)
    assert stream.sent == []
    T = [pose(so3_exp(np.array([0.1, 0.2, 0.3 * i])), np.array([i, 2.0, 3.0])) for i in range(3)]
    for i in range(3):
        poses.add(0.1 * i, 7, T[i])
    poses.send(stream)
    poses.send(stream)
    ((entity, indexes, columns),) = stream.sent
    assert entity == "robot"
    assert [len(index.as_arrow_array()) for index in indexes] == [3, 3]
    together = {str(c.component_descriptor()): c.as_arrow_array().to_pylist() for c in columns}
    for i in range(3):
        for batch in shapes.transform(T[i]).as_component_batches():
            one = np.ravel(batch.as_arrow_array().to_pylist())
            assert np.allclose(np.ravel(together[str(batch.component_descriptor())][i]), one)
