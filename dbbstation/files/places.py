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


def unused_path(folder: Path, name: str, suffix: str = "") -> Path:
    """Return a path of that name that does not exist, with a number where it has to.

    Args:
        name: of a folder, or of a file without its ending.
        suffix: ending of a file.
    """
    numbered = (folder / f"{name if k == 1 else f'{name}-{k}'}{suffix}" for k in range(1, MOST_NUMBERED))
    return next(path for path in numbered if not path.exists())


MOST_NUMBERED = 10_000
"""Names with a number that are tried."""


def name_of(path: Path) -> str:
    r"""Return what a path leads to is called, as a text: a byte of the name that is no UTF-8 is shown, such as `\xfc`.

    Python has half of a surrogate pair for such a byte, which no file in UTF-8 can hold.
    """
    return text_of_name(real_path(path).name)


def text_of_name(name: str) -> str:
    """Return a name, or a path, as a text, as `name_of` does."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")
