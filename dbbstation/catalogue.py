"""What is found by its name: error sources, NC dialects, instruments. One way for all of them.

A class of the package stands in a file of its own in a folder, and is found by looking. One of an installed package is named
by an entry point. `dbbstation.files.own_classes` finds those of Python files that a user names.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
import pkgutil
import traceback
from dataclasses import dataclass
from inspect import getmembers, isabstract, isclass
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Generic, Protocol, TypeVar

from dbbstation.errors import Problem, StationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from types import ModuleType


class Named(Protocol):
    """What has a name."""

    name: ClassVar[str]


Thing = TypeVar("Thing", bound=Named)
Base = TypeVar("Base")
Value = TypeVar("Value")


@dataclass(frozen=True)
class FoundClass(Generic[Base]):
    """A class that is not the package's.

    Attributes:
        place: where it was found: file and line, or entry point.
    """

    kind: type[Base]
    place: Problem
    remedy: str


def in_folders(base: type[Thing], *folders: ModuleType) -> Mapping[str, Thing]:
    """One instance of every class of the package, sorted by name.

    Args:
        base: what the classes derive from. Abstract ones and those whose name begins with an underscore do not count.
    """
    found: dict[str, Thing] = {}
    for folder in folders:
        for module in pkgutil.iter_modules(folder.__path__):
            content = importlib.import_module(f"{folder.__name__}.{module.name}")
            for kind in classes_of(content, base):
                if not isabstract(kind):
                    one = kind()
                    found[one.name] = one
    return MappingProxyType(dict(sorted(found.items())))


def classes_of(module: ModuleType, base: type[Base]) -> list[type[Base]]:
    """Return the public classes that a module itself defines, abstract ones too."""
    members = [member for _, member in getmembers(module, isclass) if member.__module__ == module.__name__]
    return [member for member in members if issubclass(member, base) and not member.__name__.startswith("_")]


def installed(group: str, base: type[Base], faults: list[Problem]) -> list[FoundClass[Base]]:
    """Classes that entry points of installed packages name; what cannot be loaded is added to `faults`."""
    found = []
    for point in loaded(group, faults):
        if isclass(point.value) and issubclass(point.value, base):
            found.append(FoundClass(point.value, point.place, point.remedy))
        else:
            what = f"{point.named} is no class that derives from {base.__name__}"
            faults.append(Problem(point.place.file, 0, 0, what, point.remedy))
    return found


@dataclass(frozen=True)
class Loaded:
    """What an entry point of an installed package names.

    Attributes:
        value: the thing itself.
    """

    value: object
    named: str
    place: Problem
    remedy: str


def loaded(group: str, faults: list[Problem]) -> list[Loaded]:
    """Everything that entry points of a group name; what cannot be loaded is added to `faults`."""
    found = []
    for point in importlib.metadata.entry_points(group=group):
        package = "a package" if point.dist is None else f"the package {point.dist.name}"
        place = Problem(f"entry point {point.name} of {package}", 0, 0, "")
        remedy = f"mend or uninstall {package}"
        try:
            found.append(Loaded(point.load(), point.value, place, remedy))
        except Exception as error:  # noqa: BLE001 - whatever the code of somebody else raises
            faults.append(Problem(place.file, 0, 0, f"cannot be loaded: {in_words(error)}", remedy))
    return found


def added(
    found: dict[str, Thing], whose: dict[str, str], one: Thing, place: Problem, *, called: str, faults: list[Problem]
) -> None:
    """Put one more thing to those that are known; a name that is taken is added to `faults`.

    Args:
        whose: where each of them comes from, where it is not the program itself.
        called: what things of this kind are called, with their article.
    """
    if one.name in found:
        what = f"{called} `{one.name}` is known already, from {whose.get(one.name, 'dbbstation itself')}"
        faults.append(Problem(place.file, place.line, 0, what, "give it another name"))
        return
    found[one.name], whose[one.name] = one, place.file


def in_words(error: Exception) -> str:
    """Return what the code of somebody else raised, with its kind."""
    return f"{type(error).__name__}: {error}"


def line_in(error: Exception, file: str) -> int:
    """Return the last line of a file that an error came through; 0 where it did not."""
    frames = traceback.extract_tb(error.__traceback__)
    return next((frame.lineno or 0 for frame in reversed(frames) if frame.filename == file), 0)


def looked_up(
    name: str, known: Mapping[str, Value], *, called: str, error: type[StationError], how_to_add: str = ""
) -> Value:
    """Return what has a name.

    Args:
        called: what things of this kind are called.
        error: raised where nothing has the name.
        how_to_add: what the name may lack, a sentence without a full stop.

    Raises:
        StationError: nothing has this name; the nearest is named, or all that are known.
    """
    if name in known:
        return known[name]
    raise error(f"no {called} is called {name!r}", remedy="; ".join(filter(None, [nearest(name, known), how_to_add])))


def nearest(name: str, known: Iterable[str]) -> str:
    """Return the name that is spelled nearly like one, as a question, or all that are known."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(names)}"
