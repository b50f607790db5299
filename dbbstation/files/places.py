"""Where paths lead to, links followed."""

from __future__ import annotations

import os
from pathlib import Path


def real_path(path: Path) -> Path:
    """Return the absolute path of what a path leads to; of links that lead in a circle, the path of such a link.

    `Path.resolve` raises `RuntimeError` there before Python 3.13: what the system says of such a link when it is opened is a
    sentence that names it.
    """
    return Path(os.path.realpath(path))
