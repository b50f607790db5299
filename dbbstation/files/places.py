"""Where paths lead to, links followed, and what they are called."""

from __future__ import annotations

import os
from pathlib import Path


def real_path(path: Path) -> Path:
    """Return the absolute path of what a path leads to; of links that lead in a circle, the path of such a link.

    `Path.resolve` raises `RuntimeError` there before Python 3.13: what the system says of such a link when it is opened is a
    sentence that names it.
    """
    return Path(os.path.realpath(path))


def name_of(path: Path) -> str:
    r"""Return what a path leads to is called, as a text: a byte of the name that is no UTF-8 is shown, such as `\xfc`.

    Python has half of a surrogate pair for such a byte, which no file in UTF-8 can hold.
    """
    return text_of_name(real_path(path).name)


def text_of_name(name: str) -> str:
    """Return a name, or a path, as a text, as `name_of` does."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")
