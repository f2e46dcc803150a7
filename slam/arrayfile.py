"""Arrays in an .npz file, read with care: whoever made it, a line says what is wrong with it."""

from __future__ import annotations

import struct
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError

import numpy as np
from numpy.typing import NDArray

from slam.core import InputError
from slam.plainfile import size_of

MOST_BYTES = 16_000_000_000
"""Of all arrays, unpacked; a file of ours is no larger, and zeros can be packed a thousandfold."""

BROKEN = (
    *(OSError, ValueError, KeyError, TypeError, EOFError, MemoryError, RuntimeError),
    *(NotImplementedError, IndexError, OverflowError, SyntaxError, TokenError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)
"""What numpy and zipfile raise for files that are not, or no longer, theirs."""


class ArrayFile:
    """The arrays by their names, each read when it is asked for. Raises InputError that names the
    file and ``what`` was expected to be in it."""

    def __init__(self, path: Path, what: str, most_bytes: int = MOST_BYTES):
        self._path, self._what = path, what
        size_of(path)
        try:
            self._file = np.load(path, allow_pickle=False)
            members = self._file.zip.infolist()
        except (*BROKEN, AttributeError) as error:  # one array alone has no members
            raise self.wrong(_reason(error)) from error
        size = sum(member.file_size for member in members)
        if size > most_bytes:
            raise self.wrong(f"{size / 1e6:.0f} MB unpacked, at most {most_bytes / 1e6:.0f} are")

    def __getitem__(self, name: str) -> NDArray:
        try:
            return np.asarray(self._file[name])
        except BROKEN as error:
            raise self.wrong(f"{name}: {_reason(error)}") from error

    @property
    def names(self) -> list[str]:
        """Of all arrays."""
        return list(self._file.files)

    def whole(self) -> dict[str, NDArray]:
        """All arrays."""
        return {name: self[name] for name in self.names}

    def shaped(self, name: str, kinds: str, *shape: int | None) -> NDArray:
        """An array of this shape (None: any length) and of one of numpy's kinds ("f", "iu", "U")
        of finite numbers."""
        array = self[name]
        good = array.dtype.kind in kinds and array.ndim == len(shape)
        good = good and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
        if not good or (array.dtype.kind == "f" and not np.isfinite(array).all()):
            wanted = " x ".join("n" if n is None else str(n) for n in shape) or "one"
            raise self.wrong(f"{name}: {wanted} finite numbers, found {array.dtype} {array.shape}")
        return array

    def wrong(self, reason: str) -> InputError:
        """What to raise for a file that holds something else."""
        return InputError(f"{self._path}: expected {self._what} (.npz): {reason}")


def _reason(error: Exception) -> str:
    said = error.strerror if isinstance(error, OSError) else str(error)
    return " ".join((said or type(error).__name__).split())[:200]
