"""Provenance of the running command's outputs."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from dbbstation import __version__
from dbbstation.files.places import name_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.files.provenance import Provenance

PROGRAM = f"dbbstation {__version__}"

_NO_CONTENT = frozenset(
    {
        "out",
        "table",
        "allow",
        "page",
        "pdf",
        "rebuild",
        "figure",
        "log",
        "force",
        "as_json",
        "json",
        "jobs",
        "out_table",
        "scheduler",
        "anew",
    }
)
"""Parameters that affect only the place, form or speed of results, not their content. They are left out of the
provenance, so that the same inputs give the same bytes under every name."""

_GIVEN = frozenset({ParameterSource.COMMANDLINE, ParameterSource.DEFAULT_MAP, ParameterSource.ENVIRONMENT})
"""Origins of values that are no defaults of the program; the shop's settings are click's default map."""


def provenance() -> Provenance:
    """Return the provenance with the inputs read so far."""
    from dbbstation.files.provenance import made_by

    return made_by(command_of(click.get_current_context()))


def command_of(context: click.Context) -> str:
    """Return a command as typed, plus options from settings; files lose their folders."""
    words = context.command_path.split()
    for parameter in context.command.params:
        given = context.get_parameter_source(parameter.name or "") in _GIVEN
        if given and parameter.name not in _NO_CONTENT:
            words += _words(parameter, context.params.get(parameter.name or ""))
    return shlex.join(words)


def _words(parameter: click.Parameter, value: object) -> Iterator[str]:
    values = value if isinstance(value, list | tuple) else [value]
    for each in values:
        if isinstance(parameter, click.Option):
            yield parameter.opts[0]
            if parameter.is_flag:
                continue
        yield name_of(each) if isinstance(each, Path) else str(each)
