"""Error sources from outside the package: Python files that are named, and packages that are installed.

A file is run as Python code, as any module is that one imports: name only files that you would run.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import sys
import traceback
from inspect import getmembers, isabstract, isclass
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.shipped import shipped_folder
from dbbstation.files.source_text import decode, read_bytes
from dbbstation.sources.contract import ErrorSource
from dbbstation.sources.registry import known_sources
from dbbstation.sources.trial import tried, undeclared

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from dbbstation.machine.geometry import Machine

GROUP = "dbbstation.sources"
"""Entry points of this group name classes that derive from `ErrorSource`."""

CONTRACT = "see `An error source of your own` in docs/diagnosis.md"


def every_source(files: Sequence[Path] = ()) -> Mapping[str, ErrorSource]:
    """All error sources by name: the package's, those of installed packages, those of Python files.

    Args:
        files: Python files with error sources.

    Raises:
        InputError: every fault of every file and entry point: not there, not Python, no error source in it, a name
            that is taken, something that the contract asks for and that is not there or not right.
    """
    faults: list[Problem] = []
    found = dict(known_sources())
    whose = dict.fromkeys(found, "dbbstation itself")
    kinds = [*_installed(faults), *_of_files(files, faults)]
    machine = read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml") if kinds else None
    for kind, place, remedy in kinds:
        assert machine is not None  # noqa: S101 - read where there is a class to try on it
        one = _checked(kind, place, remedy, machine, faults)
        if one is None:
            continue
        if one.name in found:
            what = f"an error source `{one.name}` is known already, from {whose[one.name]}"
            faults.append(Problem(place.file, place.line, 0, what, "give it another name"))
            continue
        found[one.name], whose[one.name] = one, place.file
    if faults:
        raise InputError(faults)
    return MappingProxyType(dict(sorted(found.items())))


def sources_of(files: Sequence[Path], known: Mapping[str, ErrorSource]) -> tuple[str, ...]:
    """Names of the sources that come from these files."""
    own = {_module_name(path) for path in files}
    return tuple(name for name, source in known.items() if type(source).__module__ in own)


def _installed(faults: list[Problem]) -> list[tuple[type[ErrorSource], Problem, str]]:
    """Classes that entry points name, each with its place and what to do about its faults."""
    found = []
    for point in importlib.metadata.entry_points(group=GROUP):
        package = "a package" if point.dist is None else f"the package {point.dist.name}"
        place = Problem(f"entry point {point.name} of {package}", 0, 0, "")
        remedy = f"mend or uninstall {package}"
        try:
            kind = point.load()
        except Exception as error:  # noqa: BLE001 - whatever the code of somebody else raises
            faults.append(Problem(place.file, 0, 0, f"cannot be loaded: {_said(error)}", remedy))
            continue
        if isclass(kind) and issubclass(kind, ErrorSource):
            found.append((kind, place, remedy))
        else:
            faults.append(Problem(place.file, 0, 0, f"{point.value} is no class that derives from ErrorSource", remedy))
    return found


def _of_files(files: Iterable[Path], faults: list[Problem]) -> list[tuple[type[ErrorSource], Problem, str]]:
    """Classes of Python files, each with its place and where to read what is asked of it."""
    found = []
    for path in {path.resolve(): path for path in files}.values():
        tree = _parsed(path, faults)
        module = None if tree is None else _run(path, tree, faults)
        if tree is None or module is None:
            continue
        lines = {node.name: node.lineno for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
        own = [member for _, member in getmembers(module, isclass) if member.__module__ == module.__name__]
        # Names that begin with an underscore are other forms of a source.
        kinds = [kind for kind in own if issubclass(kind, ErrorSource) and not kind.__name__.startswith("_")]
        if not kinds:
            faults.append(Problem(str(path), 0, 0, "no class in it derives from ErrorSource", CONTRACT))
        for kind in kinds:
            others = any(issubclass(other, kind) for other in kinds if other is not kind)
            if not (isabstract(kind) and others):  # what others derive from may leave things to them
                found.append((kind, Problem(str(path), lines.get(kind.__name__, 0), 0, ""), CONTRACT))
    return found


def _parsed(path: Path, faults: list[Problem]) -> ast.Module | None:
    """Read a file as Python; None with the fault and its place added."""
    data = read_bytes(path, faults)
    text = None if data is None else decode(data, str(path), faults)
    if text is None:
        return None
    try:
        return ast.parse(text, str(path))
    except SyntaxError as error:
        what = f"is not Python: {error.msg}"
        faults.append(Problem(str(path), error.lineno or 0, error.offset or 0, what, "mend the line"))
    except ValueError as error:
        faults.append(Problem(str(path), 0, 0, f"is not Python: {error}", "name a Python file"))
    return None


def _run(path: Path, tree: ast.Module, faults: list[Problem]) -> ModuleType | None:
    """Run a file as a module of its own; None with the fault and its line added. Nothing is written beside the file."""
    module = ModuleType(_module_name(path))
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where dataclasses look up the types of their fields
    try:
        exec(compile(tree, str(path), "exec", dont_inherit=True), module.__dict__)  # noqa: S102 - asked for by name
    except Exception as error:  # noqa: BLE001 - whatever the code of somebody else raises
        del sys.modules[module.__name__]
        what = f"cannot be run: {_said(error)}"
        faults.append(Problem(str(path), _line_in(error, str(path)), 0, what, "mend the line"))
        return None
    return module


def _checked(
    kind: type[ErrorSource], place: Problem, remedy: str, machine: Machine, faults: list[Problem]
) -> ErrorSource | None:
    """Return a source made from a class; None with what it lacks added."""
    said, line = undeclared(kind), place.line
    if not said:
        try:
            source = kind()
            said = tried(source, machine)
        except Exception as error:  # noqa: BLE001 - whatever the code of somebody else raises
            said = [f"{_said(error)}, when it was tried on a circle"]
            line = _line_in(error, place.file) or line
        else:
            if not said:
                return source
    faults += [Problem(place.file, line, 0, f"{kind.__name__}: {what}", remedy) for what in said]
    return None


def _module_name(path: Path) -> str:
    """Return a name that no other file has."""
    return f"dbbstation_own_{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:16]}"


def _line_in(error: Exception, file: str) -> int:
    """Return the last line of a file that an error came through; 0 where it did not."""
    frames = traceback.extract_tb(error.__traceback__)
    return next((frame.lineno or 0 for frame in reversed(frames) if frame.filename == file), 0)


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
