"""Syntax trees of the package: tests that search for a name parse only the files that contain it."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import TYPE_CHECKING

import dbbstation

if TYPE_CHECKING:
    from collections.abc import Iterator

PACKAGE = Path(dbbstation.__file__).parent


def trees_with(words: set[str] | None, folder: str = "") -> Iterator[tuple[str, ast.Module]]:
    """Yield path and tree of each file of the package that contains one of the words.

    Args:
        words: identifiers, or words of texts; None for every file.
    """
    for path in sorted((PACKAGE / folder).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if words is None or not words.isdisjoint(re.findall(r"\w+", text)):
            yield path.relative_to(PACKAGE).as_posix(), ast.parse(text)
