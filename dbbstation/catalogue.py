"""Find error sources, NC dialects and instruments by name."""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
import pkgutil
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, replace
from inspect import getmembers, isabstract, isclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Generic, Protocol, TypeVar

from dbbstation.errors import InputError, Problem, StationError, refuse

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from types import ModuleType


class Named(Protocol):
    """A thing with a name."""

    name: ClassVar[str]


Thing = TypeVar("Thing", bound=Named)
Base = TypeVar("Base")
Value = TypeVar("Value")


@dataclass(frozen=True)
class FoundClass(Generic[Base]):
    """A class outside the package.

    Attributes:
        place: file and line, or entry point, with the remedy of its faults.
    """

    kind: type[Base]
    place: Problem

    def fault(self, what: str) -> Problem:
        """Return a fault of the class."""
        return replace(self.place, what=what)

    def broken(self, error: BaseException, when: str = "") -> Problem:
        """Return an error of the class's own code, at its line."""
        line = line_in(error, self.place.file) or self.place.line
        return replace(self.fault(f"{self.kind.__name__}: {in_words(error)}{when}"), line=line)

    def made(self, undeclared: Sequence[str], tried: Callable[[Base], Sequence[str]], when: str = "") -> Base:
        """Return an instance that passed its trial.

        Args:
            undeclared: faults of the class itself.
            tried: returns faults of an instance.
            when: what is said behind an error of its code.

        Raises:
            InputError: every fault, or the error of its code.
        """
        said = undeclared
        if not said:
            try:
                one = self.kind()
                said = tried(one)
            except FOREIGN as error:
                raise InputError([self.broken(error, when)]) from error
            if not said:
                return one
        raise InputError([self.fault(f"{self.kind.__name__}: {what}") for what in said])


class InFolders(Mapping[str, Thing]):
    """One instance of every class of the package's folders by name.

    A name that a module has is looked up in this module alone, so that the others are not imported.

    Args:
        base: abstract classes and names with an underscore do not count.
    """

    def __init__(self, base: type[Thing], *folders: ModuleType) -> None:
        self._base = base
        modules = (
            (module.name, folder.__name__) for folder in folders for module in pkgutil.iter_modules(folder.__path__)
        )
        self._modules = {name.replace("_", "-"): f"{folder}.{name}" for name, folder in modules}
        self._found: dict[str, Thing] = {}

    def __getitem__(self, name: str) -> Thing:
        if name not in self._found:
            self._import(name if name in self._modules else None)
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        self._import(None)
        return iter(sorted(self._found))

    def __len__(self) -> int:
        self._import(None)
        return len(self._found)

    def _import(self, name: str | None) -> None:
        for module in [name] if name else list(self._modules):
            for kind in classes_of(importlib.import_module(self._modules.pop(module)), self._base):
                if not isabstract(kind):
                    one = kind()
                    self._found[one.name] = one


def classes_of(module: ModuleType, base: type[Base] | tuple[type[Base], ...]) -> list[type[Base]]:
    """Return the public classes defined in a module, abstract ones too."""
    members = [member for _, member in getmembers(module, isclass) if member.__module__ == module.__name__]
    return [member for member in members if issubclass(member, base) and not member.__name__.startswith("_")]


def installed(group: str, base: type[Base], faults: list[Problem]) -> list[FoundClass[Base]]:
    """Return classes of entry points; add those that cannot be loaded to `faults`."""
    found = []
    for point in loaded(group, faults):
        if isclass(point.value) and issubclass(point.value, base):
            found.append(FoundClass(point.value, point.place))
        else:
            faults.append(replace(point.place, what=f"{point.named} is no class that derives from {base.__name__}"))
    return found


@dataclass(frozen=True)
class Loaded:
    """The object that an entry point of an installed package names."""

    value: object
    named: str
    place: Problem


def loaded(group: str, faults: list[Problem]) -> list[Loaded]:
    """Return all objects of an entry point group; add objects that cannot be loaded to `faults`."""
    found = []
    for point in importlib.metadata.entry_points(group=group):
        package = "a package" if point.dist is None else f"the package {point.dist.name}"
        place = Problem.of(f"entry point {point.name} of {package}", "", f"mend or uninstall {package}")
        try:
            found.append(Loaded(point.load(), point.value, place))
        except FOREIGN as error:
            faults.append(replace(place, what=f"cannot be loaded: {in_words(error)}"))
    return found


def files_of_packages(group: str, own: Iterable[Path], *, called: str) -> dict[str, Path]:
    """Return the program's YAML files, and those in packages that entry points name, sorted by name.

    Args:
        called: kind in words, with its article.

    Raises:
        InputError: an invalid entry point, or a taken name.
    """
    faults: list[Problem] = []
    files = {path.stem: path for path in own}
    whose = dict.fromkeys(files, "dbbstation itself")
    for point in loaded(group, faults):
        folders = [Path(folder) for folder in getattr(point.value, "__path__", ())]
        found = sorted(path for folder in folders for path in folder.glob("*.yaml"))
        if not found:
            what = f"{point.named} is no package with a file that ends in .yaml in its folder"
            faults.append(replace(point.place, what=what))
        for path in found:
            if path.stem in files:
                faults.append(_taken(point.place, f"{called} `{path.stem}`", whose[path.stem]))
            else:
                files[path.stem], whose[path.stem] = path, point.place.file
    refuse(faults)
    return dict(sorted(files.items()))


def added(
    found: dict[str, Thing], whose: dict[str, str], one: Thing, place: Problem, *, called: str, faults: list[Problem]
) -> None:
    """Add one thing, or a fault if its name is taken.

    Args:
        whose: origin of each thing that is not the program's.
        called: kind in words, with its article.
    """
    if one.name in found:
        faults.append(_taken(place, f"{called} `{one.name}`", whose.get(one.name, "dbbstation itself")))
        return
    found[one.name], whose[one.name] = one, place.file


def _taken(place: Problem, named: str, whose: str) -> Problem:
    return replace(place, what=f"{named} is known already, from {whose}", remedy="give it another name")


FOREIGN = (Exception, SystemExit)
"""Errors that foreign code can raise, including the end of the program, which only the user may request."""


def in_words(error: BaseException) -> str:
    """Return the type and text of foreign code's exception."""
    return f"{type(error).__name__}: {error}"


def line_in(error: BaseException, file: str) -> int:
    """Return the number of a file's last line in a traceback; 0 if it has none."""
    frames = traceback.extract_tb(error.__traceback__)
    return next((frame.lineno or 0 for frame in reversed(frames) if frame.filename == file), 0)


def looked_up(
    name: str, known: Mapping[str, Value], *, called: str, error: type[StationError], how_to_add: str = ""
) -> Value:
    """Return the thing with this name.

    Args:
        how_to_add: what may be missing, without a full stop.

    Raises:
        StationError: nothing has this name; the message gives the nearest name or all names.
    """
    if name in known:
        return known[name]
    raise error(f"no {called} is called {name!r}", remedy="; ".join(filter(None, [nearest(name, known), how_to_add])))


def nearest(name: str, known: Iterable[str]) -> str:
    """Return the nearest name as a question, or all known names."""
    names = list(known)
    return meant(name, names, f"known are {', '.join(names)}", "did you mean {}?")


def meant(
    name: str, known: Iterable[str], otherwise: str, asked: str = "did you mean `{}`?", likeness: float = 0.6
) -> str:
    """Return the nearest of the known names as a question, or other words if none is near."""
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=likeness)
    return asked.format(near[0]) if near else otherwise
