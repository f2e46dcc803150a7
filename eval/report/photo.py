"""Pictures of pages and screens: taken with a browser that has no window, and made small."""

from __future__ import annotations

import io
import json
import os
import select
import shutil
import subprocess
import sys
import time
from base64 import b64decode
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from tempfile import TemporaryDirectory

from slam.core import InputError

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE_S = 120.0
DRAW_S = 0.5
"""Between pictures of a page."""


def browser() -> str | None:
    """The first browser found that can take pictures of pages."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def photograph(
    address: str, size: tuple[int, int], drawn: Callable[[bytes], bool] = lambda png: True
) -> bytes:
    """A page as PNG: the first picture that is drawn, or the last one before patience ended.

    A page that computes what it shows is blank at first, on a busy machine for a minute. Raises
    InputError where no browser can take pictures.
    """
    with open_tab(address, size) as picture:
        deadline = time.monotonic() + PATIENCE_S
        while True:
            time.sleep(DRAW_S)
            png = picture()
            if drawn(png) or time.monotonic() > deadline:
                return png


@contextmanager
def open_tab(address: str, size: tuple[int, int]) -> Iterator[Callable[[], bytes]]:
    """Opens a page in a browser that has no window, and closes both; gives what takes a picture of
    it (PNG). Raises InputError where no browser can."""
    program = browser()
    if program is None:
        raise InputError(f"no browser here ({', '.join(BROWSERS)}): no picture of {address}")
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--remote-debugging-pipe"]
        options += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        options += ["--ignore-gpu-blocklist", f"--user-data-dir={folder}"]
        options.append(f"--window-size={size[0]},{size[1]}")
        with _Browser([program, *options]) as found:
            tab = found.ask("Target.createTarget", {"url": address})["targetId"]
            with_tab = {"targetId": tab, "flatten": True}
            session = str(found.ask("Target.attachToTarget", with_tab)["sessionId"])

            def picture() -> bytes:
                answer = found.ask("Page.captureScreenshot", {"format": "png"}, session)
                return b64decode(str(answer["data"]))

            yield picture


class _Browser:
    """A browser that is spoken to in the DevTools protocol: JSON through its files 3 and 4."""

    def __init__(self, command: list[str]):
        hears, self._says = os.pipe()
        self._hears, says = os.pipe()
        # The numbers are fixed by the browser; through high ones, so that none hits another.
        moved = f"import os;os.dup2({hears},98);os.dup2({says},99);os.dup2(98,3);os.dup2(99,4)"
        started = f"{moved};os.execv({command[0]!r},{command!r})"
        self._process = subprocess.Popen(
            [sys.executable, "-c", started],
            pass_fds=(hears, says),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(hears)
        os.close(says)
        self._rest = b""
        self._asked = 0

    def __enter__(self) -> _Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait()
        os.close(self._says)
        os.close(self._hears)

    def ask(
        self, method: str, parameters: Mapping[str, object], session: str | None = None
    ) -> Mapping[str, object]:
        """The answer to one request; what else the browser says is passed over."""
        self._asked += 1
        request = {"id": self._asked, "method": method, "params": parameters}
        if session is not None:
            request["sessionId"] = session
        os.write(self._says, json.dumps(request).encode() + b"\0")
        deadline = time.monotonic() + PATIENCE_S
        while (answer := self._next(deadline, method)).get("id") != self._asked:
            continue
        result = answer.get("result")
        if not isinstance(result, dict):
            raise InputError(f"browser: {method}: {answer.get('error')}")
        return result

    def _next(self, deadline: float, method: str) -> Mapping[str, object]:
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._hears], [], [], deadline - time.monotonic())
            part = os.read(self._hears, 1 << 16) if ready else b""
            if not part:
                raise InputError(f"browser: {method}: no answer")
            self._rest += part
        line, _, self._rest = self._rest.partition(b"\0")
        return dict(json.loads(line))


def small(png: bytes, longest: int = 1400) -> bytes:
    """A picture no longer than this [pixels], in 256 colours."""
    from PIL import Image

    picture = Image.open(io.BytesIO(png)).convert("RGB")
    picture.thumbnail((longest, longest))
    out = io.BytesIO()
    picture.quantize(256).save(out, "PNG", optimize=True)
    return out.getvalue()
