"""`dbbstation sources`: the known causes and their descriptions."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.cli.declared import Answer, made
from dbbstation.cli.output import print_table
from dbbstation.errors import ModelError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from dbbstation.results.sources import SourceDescription

WIDTH = 110


@made()
def sources(
    name: Annotated[str | None, Option("cause.", kind="argument-text")] = None,
    *,
    machine: Annotated[Path | None, o.MACHINE] = None,
    source_files: o.SourcePaths = (),
) -> Answer:
    r"""List the known causes of error, or describe the cause NAME.

    Each has a description, its symptoms in recordings, a way to confirm and to cure it, its equation with source, its needs, and how exactly real machines follow its formula.
    With --machine (a machine file or a session folder) the cause's parameters on this machine follow, with their usual
    sizes.

    \b
    Examples:
      dbbstation sources
      dbbstation sources backlash
      dbbstation sources gravity --machine machine.yaml
      dbbstation sources scale-bow --source-files scale_bow.py --json
    """
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.own_sources import every_source
    from dbbstation.results.sources import SourcesResult, role_of, source_description
    from dbbstation.sources.registry import sources_named

    known = every_source(source_files)
    given = None
    if machine is not None:
        given = read_machine(machine / "machine.yaml" if machine.is_dir() else machine)
    if name is not None:
        (source,) = sources_named([name], known)
        if given is not None:
            try:
                source.parameters(given)
            except ModelError as error:
                raise ModelError(error.what, where=str(machine), remedy=error.remedy) from error
        found = source_description(source, given)
        return Answer(found, _details(found))
    rows = [
        [source.name, source.belongs_to.value, role_of(source), re.split(": |[.] ", source.texts.what)[0].rstrip(".")]
        for source in known.values()
    ]
    every = SourcesResult(tuple(source_description(source) for source in known.values()))
    return Answer(every, lambda: print_table("cause, belongs to, role, what it is", rows))


def _details(told: SourceDescription) -> list[str]:
    titles = {
        "what": "What it is",
        "shows": "How it shows",
        "confirm": "How to confirm it",
        "cure": "How to cure it",
        "equation": "Equation",
        "origin": "From",
    }
    lines = [told.name]
    for key, title in titles.items():
        lines += ["", f"{title}:", *_wrapped(getattr(told, key))]
    varies = f"its error follows the {told.varies_with}" if told.varies_with else "its error follows the pose"
    exact = told.form_uncertainty
    lines += [
        "",
        "In a model:",
        f"  {told.role}; belongs to the {told.belongs_to}; {varies}; needs {', '.join(told.needs)}",
        f"  real machines follow the formula to {100 * exact:.0f} % of the effect, one standard deviation"
        if exact
        else "  the formula is exact",
    ]
    if told.parameters is not None:
        lines += ["", "Parameters:"]
        for p in told.parameters:
            lines += _wrapped(f"{p.name}, usually {p.usual_size:g} {p.unit}: {p.meaning}", hanging="  ")
    return lines


def _wrapped(text: str, hanging: str = "") -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="  " + hanging)
