from pathlib import Path

import numpy as np

from eval.bench.semantics import room_map
from eval.studies.confusion import confusion_png
from semantics.dataset import Sample
from semantics.detector import CONSERVATIVE
from semantics.preprocess import Preprocessor


def test_a_picture_is_made_of_however_few_samples(tmp_path: Path) -> None:
    pieces = Preprocessor()(room_map(8))
    room = np.array([0, 0, 0, -1, 1, 1, 1, 1])
    sample = Sample(pieces, pieces.plane_id, room, np.zeros((0, 2), dtype=np.int64))
    path = confusion_png(CONSERVATIVE.weights, [sample], tmp_path / "confusion.png")
    assert path.read_bytes().startswith(b"\x89PNG")
