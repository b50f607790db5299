"""Physics of one's own on a table: classes of Python files that derive from a contract which the caller names."""

from __future__ import annotations

from inspect import isabstract
from typing import TYPE_CHECKING, TypeVar

from dbbstation.catalogue import in_words, line_in
from dbbstation.errors import InputError, Problem
from dbbstation.files.own_classes import classes_in_files

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

_Contract = TypeVar("_Contract")

CONTRACT = "see `Physics of your own` in docs/mismatch.md"


def own_table_sources(files: Sequence[Path], base: type[_Contract]) -> list[_Contract]:
    """Instances of all classes of Python files that derive from a contract.

    Raises:
        InputError: every fault of every file: not there, not Python, no such class in it, something that the contract asks for
            and that is not there, a name that another one has.
    """
    faults: list[Problem] = []
    found: dict[str, _Contract] = {}
    for one_of in classes_in_files(files, base, CONTRACT, faults):
        kind, place = one_of.kind, one_of.place
        lacking = [name for name in ("name", "needs", "texts") if not hasattr(kind, name)]
        if isabstract(kind):
            lacking += sorted(getattr(kind, "__abstractmethods__", ()))
        if lacking:
            faults.append(Problem(place.file, place.line, 0, f"{kind.__name__} lacks {', '.join(lacking)}", CONTRACT))
            continue
        try:
            one = kind()
        except Exception as error:  # noqa: BLE001 - whatever the code of somebody else raises
            line = line_in(error, place.file) or place.line
            faults.append(Problem(place.file, line, 0, f"{kind.__name__}: {in_words(error)}", CONTRACT))
            continue
        name = str(getattr(one, "name", ""))
        if name in found:
            faults.append(Problem(place.file, place.line, 0, f"the name `{name}` is taken", "give it another name"))
            continue
        found[name] = one
    if faults:
        raise InputError(faults)
    return list(found.values())
