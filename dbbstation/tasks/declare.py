"""A task's signature declares its parameters once. Command line, checks, documentation and messages are made from it.

A parameter without an `Option` is for Python only. This module loads fast, since help texts need it.
"""

from __future__ import annotations

import contextlib
import difflib
import functools
import inspect
import math
import re
import sys
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from dbbstation.errors import ArgumentError
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    Names = str | Sequence[str]
    File = str | PathLike[str]
    Files = File | Iterable[File]
else:
    Names, File, Files = tuple[str, ...], Path, tuple[Path, ...]


def paths_of(files: Files) -> list[Path]:
    """Return one file or folder, or several, as paths."""
    return [Path(files)] if isinstance(files, str | PathLike) else [Path(one) for one in files]


_OF_ALL = {"progress": "called with each stage.", "stop": "asked at each stage.", "say": "called with notes."}
"""Parameters of every task for Python only."""

EXAMPLES = "\\b\nExamples:"
"""First line of a command's examples in the docstring of its task."""

_NAMES, _FILES = tuple[str, ...], tuple[Path, ...]
_Function = TypeVar("_Function", bound="Callable[..., Any]")


@dataclass(frozen=True, kw_only=True)
class Option:
    """Facts of a parameter beyond its name, type and default.

    Attributes:
        help: one or two sentences, the unit in brackets; for a flag that is True by default, the meaning of its
            absence.
        kind: `argument` and `argument-file` have no flag; `path`, `file` or `folder`; empty: by the type.
        usual: effect of its absence, shown as default.
        least: with `most` and `above`, the range of a number.
        factor: converts a setting from another unit.
        goes_with: option that makes the command ignore the setting.
        objects: scripts may give objects instead of paths.
        whole: commas do not separate values.
        flag: name on the command line; empty: the parameter's.
        required: needed on the command line; scripts may omit it.
        parse: converts the command line's texts to a value, or raises ValueError.
    """

    help: str = field(kw_only=False)
    kind: str = ""
    metavar: str | None = None
    usual: str = ""
    setting: str = ""
    least: float | None = None
    most: float | None = None
    above: float | None = None
    only_with: str = ""
    not_with: tuple[str, ...] = ()
    factor: float = 1.0
    goes_with: str = ""
    objects: bool = False
    whole: bool = False
    flag: str = ""
    required: bool = False
    parse: Callable[[Any], Any] | None = None


@dataclass(frozen=True)
class TaskParameter:
    """A parameter with an `Option`."""

    name: str
    type: Any
    default: Any
    option: Option

    @property
    def many(self) -> bool:
        """Return whether the parameter has several values."""
        return get_origin(self.type) is tuple

    @property
    def flag(self) -> str:
        """Return the parameter's name on the command line."""
        if self.option.kind.startswith("argument"):
            return self.option.metavar or self.name
        return self.option.flag or f"--{'no-' if self.default is True else ''}{self.name.replace('_', '-')}"

    def says(self, value: Any) -> bool:  # noqa: ANN401 - of any parameter
        """Return whether a value differs from the default."""
        return value is not None and not (isinstance(value, str | int | float | tuple) and value in (self.default, ()))

    def checked(self, value: Any) -> Any:  # noqa: ANN401 - of any parameter
        """Return a checked value for the task.

        Raises:
            ArgumentError: the task does not accept the value.
        """
        if value is self.default:
            return value
        try:
            return self._read(value)
        except (TypeError, ValueError) as error:
            kind = _KINDS.get(self.type, "value for it")
            what = str(error) if isinstance(error, ValueError) else f"`{value!r:.60}` is no {kind}"
            raise ArgumentError(self.name, what) from None

    @property
    def in_words(self) -> str:
        """Return the parameter's type as text for signatures."""
        kind = "Any" if self.option.parse else _SIGNED.get(self.type, getattr(self.type, "__name__", "Any"))
        if get_origin(self.type) is Literal:
            kind = f"Literal[{', '.join(map(repr, get_args(self.type)))}]"
        return f"{kind} | None" if self.default is None else kind

    def _read(self, value: Any) -> Any:  # noqa: ANN401 - of any parameter
        kind = self.type
        if self.option.parse is not None:
            texts = isinstance(value, str | Path) or (
                isinstance(value, tuple) and all(isinstance(one, str) for one in value)
            )
            return self.option.parse(value) if texts else value
        if kind is Path:
            return Path(value)
        if self.many:
            return self._read_several(value)
        if get_origin(kind) is Literal:
            return _one_of(str(value), get_args(kind))
        numeric = {float: Real, int: Integral}.get(kind, kind)
        if kind in _KINDS and (not isinstance(value, numeric) or (isinstance(value, bool) and kind is not bool)):
            raise TypeError
        return self._in_range(float(value) if kind is float else value)

    def _read_several(self, value: Any) -> Any:  # noqa: ANN401 - of any parameter
        if self.type == _FILES:
            given = [value] if isinstance(value, str | PathLike) else value
            if self.option.objects and not isinstance(given, list | tuple):
                return given
            return tuple(one if self.option.objects and not isinstance(one, str) else Path(one) for one in given)
        texts = [value] if isinstance(value, str) else list(value)
        if self.option.whole:
            return tuple(texts)
        names = dict.fromkeys(name.strip() for text in texts for name in text.split(",") if name.strip())
        kind = get_args(self.type)[0]
        return tuple(_one_of(name, get_args(kind)) if get_origin(kind) is Literal else name for name in names)

    def _in_range(self, value: Any) -> Any:  # noqa: ANN401 - of any parameter
        one = self.option
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number")
        beyond = ((one.least, "at least", -1), (one.most, "at most", 1))
        for end, word, sign in beyond:
            if end is not None and sign * value > sign * end:
                raise ValueError(f"{value:g} is out of range: {word} {end:g}")
        if one.above is not None and value <= one.above:
            raise ValueError(f"{value:g} is out of range: it must be more than {one.above:g}")
        return value


_SIGNED: dict[Any, str] = {_NAMES: "str | Sequence[str]", _FILES: "path or paths", Path: "str | PathLike"}
_KINDS: dict[Any, str] = {
    float: "number",
    int: "whole number",
    bool: "True or False",
    str: "text",
    Path: "path",
    _NAMES: "name or list of names",
    _FILES: "path or list of paths",
}


def _one_of(value: str, known: Sequence[str]) -> str:
    if value in known:
        return value
    near = difflib.get_close_matches(value, known, n=1)
    raise ValueError(
        f"{value!r} is unknown; did you mean {near[0]!r}?"
        if near
        else f"{value!r} is not one of {', '.join(map(repr, known))}"
    )


@dataclass(frozen=True)
class Declared:
    """A declared task.

    Attributes:
        stages: of its work and the passed share of time as each begins [%]; a function of the arguments; None: counted.
    """

    name: str
    label: str
    stages: Any
    help: str
    parameters: Mapping[str, TaskParameter]
    signature: inspect.Signature

    def checked(self, args: tuple[Any, ...], named: Mapping[str, Any]) -> inspect.BoundArguments:
        """Return checked arguments for the task.

        Raises:
            ArgumentError: the task does not accept a value, or a combination of values.
        """
        bound = self.signature.bind(*args, **named)
        there = []
        for name in self.parameters.keys() & bound.arguments.keys():
            value = bound.arguments[name] = self.parameters[name].checked(bound.arguments[name])
            there += [name] if self.parameters[name].says(value) else []
        for name in (one for one in self.parameters if one in there):
            option = self.parameters[name].option
            if option.only_with and option.only_with not in there:
                raise ArgumentError(name, f"`{name}` needs `{option.only_with}`")
            for other in option.not_with:
                if other in there:
                    raise ArgumentError(other, f"`{other}` cannot be combined with `{name}`")
        return bound


def task(name: str, *, label: str = "", stages: Any = None) -> Callable[[_Function], _Function]:  # noqa: ANN401 - see `Declared`
    """Make a function a task, whose arguments are checked and whose docstring lists its options."""

    def give(function: _Function) -> _Function:
        parameters, signature = options_of(function), _with_hooks(inspect.signature(function))
        options = {name: one.option for name, one in parameters.items()}
        text = inspect.cleandoc(function.__doc__ or "")
        head, rest = re.split(r"\n\nArgs:\n|(?=\n\n(?:Returns|Raises):\n)", text, maxsplit=1)
        known = Declared(name, label or name, stages, head, parameters, signature)

        @functools.wraps(function)
        def call(*args: Any, **named: Any) -> Any:  # noqa: ANN401 - as the task has it
            bound = known.checked(args, named)
            return function(*bound.args, **bound.kwargs)

        told = {n: f"{one.help} [default: {one.usual}]" if one.usual else one.help for n, one in options.items()}
        told = {n: f"False: {text}" if parameters[n].default is True else text for n, text in told.items()}
        told |= {name: text for name, text in _OF_ALL.items() if f"    {name}: " not in rest}
        lines = "".join(f"    {name}: {text}\n" for name, text in told.items() if name in signature.parameters)
        written = f"{head.partition(EXAMPLES)[0].strip()}\n\nArgs:\n{lines}{rest}"
        call.__doc__ = re.sub(r"--(?:no-)?([a-z-]+)", lambda flag: f"`{flag[1].replace('-', '_')}`", written)
        call.declared = known  # type: ignore[attr-defined]
        shown = [
            one.replace(annotation=parameters[one.name].in_words) if one.name in parameters else one
            for one in signature.parameters.values()
        ]
        call.__signature__ = signature.replace(parameters=shown)  # type: ignore[attr-defined]
        return call  # type: ignore[return-value]

    return give


def _with_hooks(signature: inspect.Signature) -> inspect.Signature:
    """Return the signature with the arguments of `Hooks` by name."""
    named = {one.kind: one for one in signature.parameters.values()}
    own = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
    hooks = inspect.signature(Telling).parameters.values() if inspect.Parameter.VAR_KEYWORD in named else ()
    return signature.replace(parameters=[*own, *(one.replace(kind=one.KEYWORD_ONLY) for one in hooks)])


def options_of(function: Callable[..., Any]) -> dict[str, TaskParameter]:
    """Return the parameters of a function, or the fields of a dataclass, that have an `Option`, by name."""
    found = {}
    for name, (annotation, one) in annotations_of(function).items():
        kinds = [annotation, *(get_args(annotation) if get_origin(annotation) in {Union, UnionType} else ())]
        option = next(
            (mark for kind in kinds for mark in getattr(kind, "__metadata__", ()) if isinstance(mark, Option)), None
        )
        if option is not None:
            found[name] = TaskParameter(name, _plain(annotation), one.default, option)
    return found


def annotations_of(function: Callable[..., Any]) -> dict[str, tuple[Any, inspect.Parameter]]:
    """Return annotation and parameter by name, of a function or a dataclass; types for type checkers are left out."""
    own, found = inspect.unwrap(function), {}
    homes = {
        name: kind for kind in reversed(getattr(own, "__mro__", ())) for name in vars(kind).get("__annotations__", ())
    }
    for name, one in inspect.signature(own).parameters.items():
        with contextlib.suppress(NameError):
            names = vars(sys.modules[homes.get(name, own).__module__])
            found[name] = (eval(one.annotation, names), one)  # noqa: S307 - of our own source
    return found


def _plain(kind: Any) -> Any:  # noqa: ANN401 - a type
    if get_origin(kind) is Annotated:
        return _plain(kind.__origin__)
    if get_origin(kind) not in {Union, UnionType}:
        return kind
    others = [one for one in get_args(kind) if one is not NoneType]
    return _plain(others[0]) if len(others) == 1 else Any


def drawing(figure: str, *given: object) -> Callable[[object], Any]:
    """Return what draws a figure.

    Args:
        figure: name of the figure's module and function.
        given: the figure's arguments before the wanted output.
    """
    return partial(_drawn, figure, given)


def _drawn(figure: str, given: tuple[object, ...], wanted: object) -> Any:  # noqa: ANN401 - as asked for
    from dbbstation.report.figure_format import figure_format

    return getattr(import_module(f"dbbstation.report.{figure}"), figure)(*given, figure_format(wanted))
