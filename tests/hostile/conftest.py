"""Makes the helpers here, and those that make valid files, importable."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
PLACES = (".", "../worlds", "../eval", "../eval/recordings")
for folder in (HERE / place for place in PLACES):
    sys.path.insert(0, str(folder))
