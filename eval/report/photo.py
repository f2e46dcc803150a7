"""Pictures of pages and screens: taken with a browser that has no window, and made small."""

from __future__ import annotations

import io
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from slam.core import InputError

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE_S = 120.0


def browser() -> str | None:
    """The first browser found that can take pictures of pages."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def photograph(address: str, size: tuple[int, int], draw_s: float = 0.0) -> bytes:
    """A page as PNG. draw_s: how long it may draw. Raises InputError where no browser can."""
    program = browser()
    if program is None:
        raise InputError(f"no browser here ({', '.join(BROWSERS)}): no picture of {address}")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "page.png"
        options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--enable-unsafe-swiftshader"]
        options += [f"--user-data-dir={folder}/profile", f"--window-size={size[0]},{size[1]}"]
        options += [f"--timeout={1000 * draw_s:.0f}"] if draw_s else []
        command = [program, *options, f"--screenshot={path}", address]
        try:
            subprocess.run(command, capture_output=True, timeout=PATIENCE_S, check=False)
        except subprocess.TimeoutExpired as error:
            raise InputError(f"{program}: no picture of {address} in time") from error
        if not path.exists():
            raise InputError(f"{program}: no picture of {address}")
        return path.read_bytes()


def small(png: bytes, longest: int = 1400) -> bytes:
    """A picture no longer than this [pixels], in 256 colours."""
    from PIL import Image

    picture = Image.open(io.BytesIO(png)).convert("RGB")
    picture.thumbnail((longest, longest))
    out = io.BytesIO()
    picture.quantize(256).save(out, "PNG", optimize=True)
    return out.getvalue()
