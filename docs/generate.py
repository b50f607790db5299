"""Pages that are written at every build: one per command, one per package, and the stored results of studies."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import json
import pkgutil
import re
from typing import TYPE_CHECKING

import click

import dbbstation
from dbbstation.cli import COMMANDS, cli
from dbbstation.diagnosis.drive.sources import known_drive_sources
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.places import shipped_folder
from dbbstation.sources.registry import known_sources
from dbbstation.tasks.diagnosed import default_candidates

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dbbstation.laws.contract import Texts
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import ErrorSource

DESCRIBED = {
    *("own", "results", "errors", "tasks", "machine", "plan", "trace"),
    *("circles", "model", "sources", "nc", "instrument", "simulators", "calibration"),
}
"""What scripts and own classes meet. The docstrings of other packages are read in the source."""

_UNWRAPPED = "\b"

_DRIVE_SOURCES_HEAD = """\
Every cause of force that `dbbstation identify` looks for, from its own texts in `dbbstation/laws/`. The
names are what `drive --sources` takes."""

_SOURCES_HEAD = """\
Every cause that a model can contain, from its own texts in `dbbstation/sources/causes/`. The names are what
`calibrate --sources` takes. Those that a diagnosis compares have a plausible size, here for the machine in
`fixtures/machines/every-key.yaml`, and the exactness of their formula: [Diagnosis](../diagnosis.md) says what these decide."""


def write_pages(folder: Path) -> None:
    """Write all generated pages anew, touching only those that have changed."""
    pages = {f"commands/{name}.md": text for name, text in _commands()}
    pages |= {f"api/{name}.rst": text for name, text in _packages()}
    pages |= {f"validation/{name}.inc": text for name, text in results(folder.parent / "validation")}
    pages["sources.md"] = _sources()
    pages["drive-sources.md"] = _drive_sources()
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    for path in [*folder.rglob("*.md"), *folder.rglob("*.rst"), *folder.rglob("*.inc")]:
        if str(path.relative_to(folder)) not in pages:
            path.unlink()


def results(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield name and Markdown of every stored result: question, data, figures, limits, and the command that made them."""
    for path in sorted(folder.glob("*.json")):
        kept = json.loads(path.read_text(encoding="utf-8"))
        head = ["", *kept["columns"]]
        rows = [head, ["---"] * len(head), *([label, *cells] for label, cells in kept["figures"].items())]
        table = [f"| {' | '.join(map(str, row))} |" for row in rows]
        origin = [f"{word} {kept[word]}" for word in ("seed", "commit") if word in kept]
        ending = " ".join(
            [*filter(None, [kept.get("limits")]), f"`{kept['command']}`,", ", ".join([*origin, kept["date"]])]
        )
        yield path.stem, "\n".join([f"**{kept['question']}** {kept['data']}", "", *table, "", f"{ending}.", ""])


def escaped(line: str) -> str:
    """Escape bars, as in |w|, outside names in backticks."""
    return "".join(part if part.startswith("`") else part.replace("|", r"\|") for part in re.split(r"(`[^`]*`)", line))


def with_drawings(lines: list[str]) -> list[str]:
    """Make blocks of the paragraphs that are drawn: with indented lines, or columns set apart by blanks."""
    kept: list[str] = []
    for paragraph in re.split(r"\n[ \t]*\n", "\n".join(lines)):
        rows = paragraph.splitlines()
        drawn = any(row.startswith(" ") or "   " in row for row in rows)
        kept += ["::", "", *(f"    {row}" for row in rows), ""] if drawn else [*map(escaped, rows), ""]
    return kept


def _commands() -> Iterator[tuple[str, str]]:
    with click.Context(cli, info_name="dbbstation") as parent:
        for name in sorted(COMMANDS):
            command = cli.get_command(parent, name) if importlib.util.find_spec(f"dbbstation.cli.{name}") else None
            if command is None:
                continue  # announced, not written yet; tests/cli asks for all of them
            with click.Context(command, info_name=name, parent=parent) as context:
                yield name, _command(name, command, context)
                for part in command.list_commands(context) if isinstance(command, click.Group) else ():
                    inner = command.get_command(context, part)
                    with click.Context(inner, info_name=part, parent=context) as within:
                        yield f"{name}-{part}", _command(f"{name} {part}", inner, within)


def _command(name: str, command: click.Command, context: click.Context) -> str:
    usage = command.get_usage(context).removeprefix("Usage: ")
    rows = [row for parameter in command.get_params(context) if (row := parameter.get_help_record(context))]
    options = [f"| `{_cell(option)}` | {_cell(text)} |" for option, text in rows]
    table = ["| option | |", "| --- | --- |", *options]
    return "\n".join(
        [f"# {name}", "", "```text", usage, "```", "", *_prose(inspect.cleandoc(command.help or "")), *table, ""]
    )


def _prose(text: str) -> Iterator[str]:
    """Give the paragraphs of a help text as Markdown; those that click must not wrap become blocks."""
    for paragraph in re.split(r"\n\s*\n", text):
        lines = paragraph.splitlines()
        if lines and lines[0].strip() == _UNWRAPPED:
            head, *rest = lines[1:]
            body = [head, "", "```console", *(_prompted(line) for line in rest), "```"]
            yield from body
        else:
            yield from lines
        yield ""


def _prompted(line: str) -> str:
    line = line.removeprefix("  ")
    return f"$ {line}" if line.startswith("dbbstation ") else line


def _cell(text: str) -> str:
    return text.replace("|", r"\|").replace("\n", " ")


def _packages() -> Iterator[tuple[str, str]]:
    for module in pkgutil.iter_modules(dbbstation.__path__):
        if module.name not in DESCRIBED:
            continue
        name = f"dbbstation.{module.name}"
        found = [name]
        if module.ispkg:
            inside = importlib.import_module(name).__path__
            found += [f"{name}.{m.name}" for m in pkgutil.iter_modules(inside) if not m.name.startswith("_")]
            found += [
                f"{package}.{m.name}"
                for package in found[1:]
                if importlib.util.find_spec(package).submodule_search_locations  # type: ignore[union-attr]
                for m in pkgutil.iter_modules(importlib.import_module(package).__path__)
            ]
        yield name, "\n".join([_headed(name, "="), *(_module(one, first=one == name) for one in found)])


def _module(name: str, *, first: bool) -> str:
    head = "" if first else _headed(name, "-")
    return f"{head}\n.. automodule:: {name}\n   :members:\n   :show-inheritance:\n"


def _headed(title: str, line: str) -> str:
    return f"{title}\n{line * len(title)}\n"


def _sources() -> str:
    lines = ["# Error sources", "", _SOURCES_HEAD, ""]
    machine = read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml")
    compared = set(default_candidates(known_sources()))
    for name, source in known_sources().items():
        needs = ", ".join(sorted(source.needs))
        logged = source.by_temperature()
        forms = f"Belongs to the {source.belongs_to}; needs {needs}"
        forms += f", or in its second form {', '.join(sorted(logged.needs))}." if logged else "."
        sizes = _sizes(source, machine) if name in compared else []
        lines += [*_texts(name, source.texts, forms), *sizes, ""]
    return "\n".join(lines)


def _sizes(source: ErrorSource, machine: Machine) -> list[str]:
    """What a diagnosis takes from a source beforehand: plausible sizes and how exact the formula is."""
    amplitudes = [parameter for parameter in source.parameters(machine) if not parameter.grid]
    sizes = dict.fromkeys(f"{p.plausible:g} {p.unit}" for p in amplitudes)
    share = source.form_uncertainty
    exact = f"real machines depart from it by {100 * share:g} % of the effect (one standard deviation)"
    return [
        f"- Plausible size, one standard deviation: {', '.join(sizes)}",
        f"- Formula: {exact if share else 'exact'}",
    ]


def _drive_sources() -> str:
    lines = ["# Causes of force in a drive", "", _DRIVE_SOURCES_HEAD, ""]
    for name, source in known_drive_sources().items():
        lines += [*_texts(name, source.texts, f"Its misfit follows {source.varies_with}."), ""]
    return "\n".join(lines)


def _texts(name: str, texts: Texts, facts: str) -> list[str]:
    return [
        f"## {name}",
        "",
        texts.what,
        "",
        f"- {facts}",
        f"- Shows: {texts.shows}",
        f"- Confirm: {texts.confirm}",
        f"- Cure: {texts.cure}",
        f"- Equation: {_plain(texts.equation)}",
        f"- From: {_plain(texts.origin)}",
    ]


def _plain(text: str) -> str:
    """Escape what Markdown would take for markup in an equation or a reference, outside names in backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(p if p.startswith("`") else re.sub(r"([\\*_\[\]<>|])", r"\\\1", p) for p in parts)
