"""Make commands from tasks: the signature gives the options; the command runs the task, writes and prints."""

from __future__ import annotations

import functools
import inspect
import math
import re
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

import click

from dbbstation.cli.output import echo_each, format_of, known_format, print_json, print_result, provenance, say
from dbbstation.cli.progress import count_bar, task_bar
from dbbstation.cli.shop import ShopOption
from dbbstation.errors import ArgumentError, OutputError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option, TaskParameter, annotations_of, options_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from click import Context, Parameter

    from dbbstation.errors import StationError
    from dbbstation.tasks.declare import Declared


class Finite(click.FloatRange):
    """A finite number, with a range as in `click.FloatRange`.

    Without this check, click accepts `nan` in every range, and `inf` in open ones.
    """

    def __init__(self, *limits: Any, **more: Any) -> None:  # noqa: ANN401 - as click has it
        super().__init__(*limits, **more)
        if self.min is None and self.max is None:
            self.name = "float"  # what help texts show

    def convert(self, value: Any, param: Parameter | None, ctx: Context | None) -> float:  # noqa: ANN401 - as click has it
        """Return the number.

        Raises:
            BadParameter: it is no number, not finite, or out of range.
        """
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number

    def _describe_range(self) -> str:
        return "" if self.min is None and self.max is None else super()._describe_range()


def save(result: Any, path: Path, *, force: bool) -> None:  # noqa: ANN401 - any result
    """Save the main product with its provenance."""
    result.save(path, force=force, provenance=provenance)


@dataclass(frozen=True)
class CommandOutput:
    """A file written from a command's result.

    Attributes:
        field: result's field for the file's name; empty: named as the option.
        write: takes result, path and `force`; by default saves the main product.
        table: gets a separate provenance file.
        refused: reason not to write the result, raised at the end.
        only_with: task parameter that must be given too.
    """

    name: str
    metavar: str | None = None
    write: Callable[..., None] = save
    folder: bool = False
    table: bool = False
    said: str = ""
    check: Callable[[Path], Path] | None = None
    refused: Callable[[Any, Path], StationError | None] = lambda _result, _path: None
    only_with: str = ""
    field: str = ""
    required: bool = False

    @property
    def option(self) -> click.Parameter:
        """Return the click option of this output."""
        of = o.OUTPUTS[self.name]
        kind = "folder" if self.folder else "file"
        said = Option(of, kind=kind, metavar=self.metavar, parse=self.check, required=self.required)
        return _checked(TaskParameter(self.name, Path, None, said))


def figure(said: str = "") -> CommandOutput:
    """Return the option `--figure FILE` for the result's figure."""
    return CommandOutput("figure", write=_draw, said=said, check=known_format)


def _draw(result: Any, path: Path, *, force: bool) -> None:  # noqa: ANN401 - any result
    from dbbstation.files.atomic import write_bytes

    if result.drawing is not None:
        write_bytes(path, result.drawing(format_of(path)), force=force)


def command(
    function: Callable[..., Any],
    show: Callable[..., None],
    *outputs: CommandOutput,
    remarks: Callable[[Any], Iterable[str]] = lambda _result: (),
    more: Callable[[], Mapping[str, object]] = dict,
) -> click.Command:
    """Make a command from a task.

    Args:
        show: prints the result; its parameters with an `Option` become options, its others come from the task.
        remarks: printed on standard error, also beside JSON.
    """
    task: Declared = function.declared  # type: ignore[attr-defined]
    shown = options_of(show)
    of_task = [name for name in list(inspect.signature(show).parameters)[1:] if name not in shown]
    with_force = "force" in task.parameters

    def run(**given: Any) -> None:  # noqa: ANN401 - each option has a type of its own
        as_json, own = given.pop("as_json"), {name: given.pop(name) for name in shown}
        paths = {one: given.pop(one.name) for one in outputs}
        paths = {one: path for one, path in paths.items() if path is not None}
        force = bool(given.get("force") if with_force else given.pop("force", False))
        for one in paths:
            if one.only_with and given[one.only_with] is None:
                raise click.UsageError(f"--{one.name} needs {task.parameters[one.only_with].flag}")
        _refuse(paths, force=force)
        result = _done(function, task, {n: v for n, v in given.items() if v not in (None, ())} | dict(more()))
        refused = [error for one, path in paths.items() if (error := one.refused(result, path))]
        result = _written(result, paths, remarks, force=force)
        if as_json:
            print_result(result)
        else:
            show(result, **own, **{name: given[name] for name in of_task})
        for error in refused:
            raise error

    options = [option_of(one) for one in {**task.parameters, **shown}.values() if one.name != "force"]
    options += [one.option for one in outputs]
    if with_force or any(not one.folder for one in outputs):
        options.append(click.Option(["--force"], is_flag=True, help=o.FORCE.help))
    options.append(click.Option(["--json", "as_json"], is_flag=True, help=o.JSON.help))
    options.sort(key=lambda one: isinstance(one, click.Option))
    return click.Command(task.name, params=options, callback=run, help=task.help)


@dataclass(frozen=True)
class Answer:
    """The answer of a command: data for `--json`, and lines or a function that prints."""

    data: Any
    words: Sequence[str] | Callable[[], None]

    def tell(self, *, as_json: bool) -> None:
        """Print the answer."""
        if as_json:
            (print_json if isinstance(self.data, dict) else print_result)(self.data)
        elif callable(self.words):
            self.words()
        else:
            echo_each(self.words)


def made(
    name: str = "", group: click.Group | None = None, kind: type[click.Command] = click.Command
) -> Callable[[Callable[..., Any]], click.Command]:
    """Make a command from a function. Parameters, and a dataclass's fields, with an `Option` become options.

    A command that returns an `Answer` also has `--json`.

    Args:
        name: command's; empty: the function's.
        group: to which the command is added.
    """

    def give(function: Callable[..., Any]) -> click.Command:
        kinds: Any = {name: kind for name, (kind, _) in annotations_of(function).items() if is_dataclass(kind)}
        parts = {name: options_of(kind) for name, kind in kinds.items()}
        every = options_of(function) | {name: one for part in parts.values() for name, one in part.items()}

        answers = inspect.signature(function).return_annotation == Answer.__name__
        as_json = TaskParameter("as_json", bool, default=False, option=replace(o.JSON, flag="--json"))
        every |= {as_json.name: as_json} if answers else {}

        @functools.wraps(function)
        def run(**given: Any) -> Any:  # noqa: ANN401 - each option has a type of its own
            told = answers and given.pop(as_json.name)
            groups = {name: kinds[name](**{one: given.pop(one) for one in part}) for name, part in parts.items()}
            found = function(**given, **groups)
            return found.tell(as_json=told) if answers else found

        options = sorted(map(_checked, every.values()), key=lambda one: isinstance(one, click.Option))
        text = inspect.cleandoc(function.__doc__ or "").replace(r"\b", "\b")
        found = kind(name or function.__name__, params=options, callback=run, help=text)
        if group is not None:
            group.add_command(found)
        return found

    return give


def _checked(one: TaskParameter) -> click.Parameter:
    found = option_of(one)

    def check(_context: click.Context, _option: click.Parameter, value: Any) -> Any:  # noqa: ANN401 - each has a type of its own
        try:
            return one.default if value is None else one.checked(value)
        except ArgumentError as error:
            raise click.BadParameter(error.what) from None

    found.callback = check
    return found


def _done(function: Callable[..., Any], task: Declared, asked: Mapping[str, Any]) -> Any:  # noqa: ANN401 - any result
    """Run a task with its progress bar; an `ArgumentError` becomes a usage error that names the option."""
    try:
        with _bar(task, asked) as progress:
            now = getattr(import_module(function.__module__), function.__name__)  # a test may have put another there
            own = {"progress": progress, "say": lambda text: say(f"note: {text}"), "provenance": provenance}
            return now(**{name: one for name, one in own.items() if name in task.signature.parameters} | dict(asked))
    except ArgumentError as error:
        flags = {name: one.flag for name, one in task.parameters.items()}
        what = f"{error.what}; {error.remedy}" if error.remedy else error.what
        told = re.sub(r"`(\w+)`", lambda found: flags.get(found[1], found[0]), what)
        at = "" if told.startswith("--") else f"{flags.get(error.where, '')}: "
        raise click.UsageError(f"{at}{told}") from None


@contextmanager
def _bar(task: Declared, asked: Mapping[str, Any]) -> Iterator[Any]:
    if task.stages is None:
        with count_bar(task.label) as tell:
            yield lambda _text, done=0, of=0: tell(done, of)
    else:
        with task_bar(task.label, task.stages(asked) if callable(task.stages) else task.stages) as tell:
            yield tell


def _refuse(paths: Mapping[CommandOutput, Path], *, force: bool) -> None:
    from dbbstation.files.atomic import refuse_outputs
    from dbbstation.files.provenance import refuse_existing_table

    for one, path in paths.items():
        if one.folder and path.exists():
            raise OutputError("the session folder exists already", where=str(path), remedy="choose another name")
        if one.table:
            refuse_existing_table(path, force=force)
    refuse_outputs((path for one, path in paths.items() if not one.folder), force=force)


def _written(
    result: Any,  # noqa: ANN401 - any result
    paths: Mapping[CommandOutput, Path],
    remarks: Callable[[Any], Iterable[str]],
    *,
    force: bool,
) -> Any:  # noqa: ANN401 - the same
    named = {one.name for one in fields(result)}
    for one, path in paths.items():
        if one.refused(result, path) is None:
            one.write(result, path, force=force)
            if one.said:
                say(one.said.format(path=path))
            field = one.field or one.name
            result = replace(result, **{field: str(path)}) if field in named else result
    for text in remarks(result):
        say(text)
    return result


_PATHS = {
    "argument": click.Path(path_type=Path),
    "argument-file": click.Path(path_type=Path, dir_okay=False),
    "path": click.Path(path_type=Path),
    "file": click.Path(path_type=Path, dir_okay=False),
    "folder": click.Path(path_type=Path, file_okay=False),
}


def option_of(one: TaskParameter) -> click.Parameter:
    """Return the click option of a task's parameter."""
    option, kind = one.option, _kind_of(one)
    required = option.required or one.default is inspect.Parameter.empty
    if option.kind.startswith("argument"):
        return click.Argument(
            [one.name], nargs=-1 if one.many else 1, required=required, metavar=option.metavar, type=kind
        )
    if isinstance(one.default, bool):
        return click.Option(
            [one.flag, one.name], is_flag=True, flag_value=not one.default, default=one.default, help=option.help
        )
    make: Any = click.Option
    if option.setting:
        make = partial(ShopOption, setting=option.setting, factor=option.factor, goes_with=option.goes_with)
    if option.usual or one.default not in (None, (), "", inspect.Parameter.empty):
        make = partial(make, default=None if required else one.default, show_default=option.usual or True)
    found: click.Option = make(
        [one.flag, one.name],
        type=kind,
        help=option.help,
        metavar=option.metavar,
        required=required,
        multiple=one.many,
    )
    return found


def _kind_of(one: TaskParameter) -> Any:  # noqa: ANN401 - a type of click
    option, kind = one.option, get_args(one.type)[0] if one.many else one.type
    if kind is Path or option.kind in _PATHS:
        return _PATHS[option.kind or "path"]
    if get_origin(kind) is Literal and (option.whole or not one.many):
        return click.Choice(get_args(kind))
    if kind is int:
        lowest, highest = (None if end is None else int(end) for end in (option.least, option.most))
        return click.IntRange(lowest, highest)
    if kind is float:
        least = option.above if option.least is None else option.least
        return Finite(least, option.most, min_open=option.above is not None)
    return click.STRING
