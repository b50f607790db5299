"""Do a task by its name, at another process's request."""

from __future__ import annotations

import shlex
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dbbstation.files.atomic import write_bytes
from dbbstation.files.places import name_of
from dbbstation.files.provenance import Provenance, made_by

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from dbbstation.files.formats.settings import Settings
    from dbbstation.tasks.declare import Declared
    from dbbstation.tasks.telling import Progress

_MODULES = {"program": "circle_programs"}
"""Module of a task, if it has another name."""

_PATHS = (Path, tuple[Path, ...])


def called(
    name: str,
    given: Mapping[str, str],
    outputs: Mapping[str, str],
    settings: Settings,
    *,
    force: bool,
    progress: Progress,
    say: Callable[[str], None],
) -> Any:  # noqa: ANN401 - the result of any task
    """Do a task, write its outputs and return its result.

    Args:
        given: values by parameter; missing values come from the settings.
        outputs: files by `out`, `figure` or `page`, unless the task has them as parameters.

    Raises:
        StationError: an error of the task, or a file exists without `force`.
    """
    function = getattr(import_module(f"dbbstation.tasks.{_MODULES.get(name, name)}"), name)
    task: Declared = function.declared
    of_shop = {
        each.name: settings.values[each.option.setting].value
        for each in task.parameters.values()
        if each.option.setting in settings.values
    }
    values = of_shop | dict(given)

    def provenance() -> Provenance:
        return made_by(shlex.join(["dbbstation", name, *words_of(function, values)]))

    more = {
        "settings": settings,
        "tolerances": settings.tolerances,
        "force": force,
        "provenance": provenance,
        "progress": progress,
        "say": say,
    }
    result = function(**values, **{n: value for n, value in more.items() if n in task.signature.parameters})
    for output, file in outputs.items():
        _write(output, result, Path(file), provenance, settings, force=force)
    return result


def words_of(function: Any, values: Mapping[str, Any]) -> Iterator[str]:  # noqa: ANN401 - any task
    """Return the words of a command line by the task's parameters, without folders and outputs."""
    for name, value in values.items():
        one = function.declared.parameters[name]
        for each in value if isinstance(value, tuple) else [value] if name not in {"out", "page"} else ():
            if one.flag.startswith("--"):
                yield one.flag
            if each is not True:
                yield name_of(Path(each)) if one.option.kind == "file" or one.type in _PATHS else str(each)


def _write(
    output: str,
    result: Any,  # noqa: ANN401 - of any task
    file: Path,
    provenance: Callable[[], Provenance],
    settings: Settings,
    *,
    force: bool,
) -> None:
    if output == "out":
        result.save(file, force=force, provenance=provenance)
    elif output == "figure":
        from dbbstation.report.figure_format import FigureFormat, Stamped

        write_bytes(file, result.drawing(Stamped(FigureFormat(file.suffix), provenance())), force=force)
    else:
        from dbbstation.report.history_page import history_html

        write_bytes(file, history_html(result, provenance(), settings.tolerances_from), force=force)
