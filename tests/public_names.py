"""Signatures of the public names and the fields of their results, as one text.

`python -m tests.public_names` keeps them in `public_names.txt` anew, once the changelog has a further line that begins with `- Python:`.
"""

from __future__ import annotations

import dataclasses
import inspect
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import dbbstation
import dbbstation.results

KEPT = Path(__file__).with_suffix(".txt")
CHANGELOG = Path(__file__).parents[1] / "CHANGELOG.md"
TOLD = "- Python:"
COUNT = "lines of the changelog that begin with `- Python:`: "


def lines_told():
    return sum(line.startswith(TOLD) for line in CHANGELOG.read_text(encoding="utf-8").splitlines())


def signatures():
    """What scripts rely on: parameters with their defaults, fields of results, and what results can do."""
    modules = [import_module(f"dbbstation.results.{each.name}") for each in iter_modules(dbbstation.results.__path__)]
    kinds = {name: one for each in modules for name, one in vars(each).items() if dataclasses.is_dataclass(one)}
    lines, results = [], {}
    for name in sorted(set(dbbstation.__all__) - {"__version__"}):
        one = getattr(dbbstation, name)
        if inspect.isclass(one):
            lines.append(f"{name}: class")
            continue
        found = inspect.signature(one)
        parameters = ", ".join(_parameter(each) for each in found.parameters.values())
        lines.append(f"{name}({parameters}) -> {found.return_annotation}")
        for returned in str(found.return_annotation).split(" | "):
            if returned in kinds:
                results[returned] = kinds[returned]
    for name, kind in sorted(results.items()):
        fields = {field.name for field in dataclasses.fields(kind)}
        lines += [f"{name}.{each}" for each in sorted(fields | {each for each in dir(kind) if each[0] != "_"})]
    return "\n".join(lines) + "\n"


def _parameter(one):
    star = {one.KEYWORD_ONLY: "*", one.VAR_KEYWORD: "**"}.get(one.kind, "")
    default = "" if one.default is one.empty else f" = {getattr(one.default, '__name__', repr(one.default))}"
    return f"{star}{one.name}: {one.annotation}{default}"


def kept():
    first, _, rest = KEPT.read_text(encoding="utf-8").partition("\n")
    return int(first.removeprefix(COUNT)), rest


def main():
    if KEPT.exists():
        count, before = kept()
        if before != signatures() and lines_told() <= count:
            sys.exit(f"say in the changelog what changes, in a line that begins with `{TOLD}`")
    KEPT.write_text(f"{COUNT}{lines_told()}\n{signatures()}", encoding="utf-8")


if __name__ == "__main__":
    main()
