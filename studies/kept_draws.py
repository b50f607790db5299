"""Draws of a long study in a file, to resume it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from dbbstation.errors import StationError
from studies.random_machines import over_machines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path


def drawn(experiment: Callable[[int], Any], numbers: Sequence[int], path: Path | None, what: str) -> Iterator[Any]:
    """Yield the experiment's result for every number, in order.

    The file has a title line and a line per draw; known draws are reused.

    Args:
        experiment: as of `over_machines`; JSON results.
        path: None: keep nothing.
        what: study, circumstances, first seed.

    Raises:
        StationError: the file has other draws.
    """
    if path is None:
        yield from over_machines(experiment, numbers)
        return
    known = _read(path, what)
    results = iter(over_machines(experiment, [number for number in numbers if number not in known]))
    with path.open("a", encoding="utf-8") as file:
        if not path.stat().st_size:
            file.write(json.dumps({"draws_of": what}) + "\n")
        for number in numbers:
            if number in known:
                yield known[number]
                continue
            result = next(results)
            file.write(json.dumps([number, result]) + "\n")
            file.flush()
            yield result


def _read(path: Path, what: str) -> dict[int, Any]:
    """Read draws; remove an incomplete last line."""
    if not path.exists() or not path.stat().st_size:
        return {}
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    try:
        first, *lines = [json.loads(line) for line in whole.splitlines()] or [{}]
        if first != {"draws_of": what}:
            raise StationError(
                f"has no draws of: {what}", where=str(path), remedy="name another file, or none that exists"
            )
        return {int(number): result for number, result in lines}
    except (ValueError, TypeError) as error:
        raise StationError(
            f"is no file of draws: {error}", where=str(path), remedy="name another file, or none that exists"
        ) from error
