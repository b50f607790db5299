"""Load error sources and NC dialects from a user's Python files.

A file is run as Python code: name only trusted files.
"""

from __future__ import annotations

import ast
import os
import sys
from inspect import isabstract
from types import ModuleType
from typing import TYPE_CHECKING, TypeVar

from dbbstation.catalogue import FOREIGN, FoundClass, classes_of, in_words, line_in
from dbbstation.errors import Problem, refuse
from dbbstation.files.gateway import sha256_hex
from dbbstation.files.places import real_path
from dbbstation.files.source_text import LARGEST_PROGRAM, text_in
from dbbstation.laws.contract import TableSource

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Sequence
    from pathlib import Path


Base = TypeVar("Base")


def classes_in_files(
    files: Iterable[Path], base: type[Base] | tuple[type[Base], ...], contract: str, faults: list[Problem]
) -> list[FoundClass[Base]]:
    """Return classes that derive from `base`, each with its place.

    Args:
        base: one class or several; abstract base classes and names with a leading underscore do not count.
        faults: grows by files that are missing, not Python, or lack such a class.
    """
    found = []
    for path in {real_path(path): path for path in files}.values():
        tree = _parsed(path, faults)
        module = None if tree is None else _run(path, tree, faults)
        if tree is None or module is None:
            continue
        lines = {node.name: node.lineno for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
        kinds = classes_of(module, base)
        if not kinds:
            names = " or ".join(one.__name__ for one in (base if isinstance(base, tuple) else (base,)))
            faults.append(Problem.of(path, f"no class in it derives from {names}", contract))
        for kind in kinds:
            others = any(issubclass(other, kind) for other in kinds if other is not kind)
            if not (isabstract(kind) and others):  # what others derive from may leave things to them
                found.append(FoundClass(kind, Problem.of(path, "", contract, lines.get(kind.__name__, 0))))
    return found


def own_instances(
    files: Iterable[Path],
    base: type[Base],
    contract: str,
    attributes: Iterable[str],
    fault_of: Callable[[Base], tuple[str, str] | None] = lambda _one: None,
) -> list[Base]:
    """Return instances of all classes that derive from `base`, by distinct names.

    Args:
        attributes: required, with `name`.
        fault_of: fault and remedy of an instance; may run its code.

    Raises:
        InputError: every fault: a file missing, not Python or without such a class, a missing requirement, a taken name, failing
            code.
    """
    faults: list[Problem] = []
    found: dict[str, Base] = {}
    for one_of in classes_in_files(files, base, contract, faults):
        lacking = [name for name in attributes if not hasattr(one_of.kind, name)]
        lacking += sorted(getattr(one_of.kind, "__abstractmethods__", ()))
        if lacking:
            faults.append(one_of.fault(f"{one_of.kind.__name__} lacks {', '.join(lacking)}"))
            continue
        try:
            one = one_of.kind()
            fault = fault_of(one)
        except FOREIGN as error:
            faults.append(one_of.broken(error))
            continue
        name = str(getattr(one, "name", ""))
        if fault is None and name in found:
            fault = f"the name `{name}` is taken", "give it another name"
        if fault is not None:
            faults.append(Problem.of(one_of.place.file, *fault, one_of.place.line))
        found.setdefault(name, one)
    refuse(faults)
    return list(found.values())


def module_name(path: Path) -> str:
    """Return a name that no other file has."""
    return f"dbbstation_own_{sha256_hex(os.fsencode(real_path(path)))[:16]}"


def _parsed(path: Path, faults: list[Problem]) -> ast.Module | None:
    text = text_in(path, faults, LARGEST_PROGRAM)
    if text is None:
        return None
    try:
        return ast.parse(text, str(path))
    except SyntaxError as error:
        what = f"is not Python: {error.msg}"
        faults.append(Problem.of(path, what, "mend the line", error.lineno or 0, error.offset or 0))
    except ValueError as error:
        faults.append(Problem.of(path, f"is not Python: {error}", "name a Python file"))
    except (MemoryError, RecursionError):
        faults.append(Problem.of(path, "is nested too deeply", "name a file that was written by hand"))
    return None


def _run(path: Path, tree: ast.Module, faults: list[Problem]) -> ModuleType | None:
    """Run a file as a module without writing beside it; None with the fault and its line added."""
    module = ModuleType(module_name(path))
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where dataclasses look up the types of their fields
    try:
        exec(compile(tree, str(path), "exec", dont_inherit=True), module.__dict__)  # noqa: S102 - asked for by name
    except FOREIGN as error:
        del sys.modules[module.__name__]
        what = f"cannot be run: {in_words(error)}"
        faults.append(Problem.of(path, what, "mend the line", line_in(error, str(path))))
        return None
    return module


CONTRACT = "see `Physics of your own` in docs/mismatch.md"


def load_sources(
    files: Sequence[Path], columns: Container[str], where: str = "the table"
) -> tuple[list[TableSource], dict[str, str]]:
    """Return user physics whose columns exist, and the missing columns of other user physics by name.

    Raises:
        InputError: every fault: a file missing, not Python or without such a class, a missing requirement, a taken name.
    """
    usable: list[TableSource] = []
    lacking = {}
    for source in own_instances(files, TableSource, CONTRACT, ("name", "needs", "texts")):  # type: ignore[type-abstract]
        missing = [name for name in source.needs if name not in columns]
        if missing:
            lacking[source.name] = f"{where} has no column {', '.join(missing)}"
        else:
            usable.append(source)
    return usable, lacking
