"""Output of commands: data on standard output, messages on standard error."""

from __future__ import annotations

import json
import logging
import sys
from typing import TYPE_CHECKING

import click

from dbbstation.text.written import on_one_line, printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty U = k u that people read: about 95 % of a normal distribution [GUM 6.3.3]."""

EXPANDED = f"U (k = {COVERAGE_FACTOR:g})"
"""Name of the expanded uncertainty in headings."""

_LONGEST_CELL = 300
"""Greatest number of printed characters of a cell; a path has little more than a hundred."""

_LOG = logging.getLogger(__name__)


def echo(text: object = "", *, err: bool = False, nl: bool = True) -> None:
    """Print text; all output to a terminal uses this function."""
    # While a bar is drawn Rich stands in for standard error and puts lines above the bar; Click would look through it.
    above = sys.stderr if err and hasattr(sys.stderr, "rich_proxied_file") else None
    click.echo(printable(str(text)), above, err=err, nl=nl)


def print_json(data: Mapping[str, object]) -> None:
    """Print a JSON object with its provenance; refuse numbers that are not finite."""
    from dbbstation.cli.provenance import provenance

    print_plain_json({**data, "provenance": provenance().data()})


def print_result(result: object) -> None:
    """Print a result as JSON with its provenance."""
    from dbbstation.facts.serialise import plain

    print_json(plain(result))


def print_plain_json(data: Mapping[str, object]) -> None:
    """Print a JSON document such as a schema."""
    echo(json_text(data, indent=1))


def json_text(data: Mapping[str, object], indent: int | None = None) -> str:
    """Return data as JSON, with DEL escaped for terminals too."""
    return json.dumps(data, indent=indent, allow_nan=False).replace("\x7f", "\\u007f")


def print_table(titles: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows under titles, numbers aligned right, texts left."""
    texts = [[_text(cell) for cell in row] for row in rows]
    numeric = [all(_is_number(row[k]) for row in texts if row[k]) for k in range(len(titles))]
    widths = [max(len(title), *(len(row[k]) for row in texts), 0) for k, title in enumerate(titles)]
    for row in [list(titles), *texts]:
        cells = [c.rjust(w) if n else c.ljust(w) for c, w, n in zip(row, widths, numeric, strict=True)]
        echo("  ".join(cells).rstrip())


def say(text: str) -> None:
    """Print a note and log it, on one line even if names contain line ends."""
    log_said(text)
    echo(on_one_line(text), err=True)


def echo_line(text: str) -> None:
    """Print text on one line, even with line ends in names."""
    echo(on_one_line(text))


def log_said(text: str) -> None:
    """Log a text that the user sees anyway, hidden from `--verbose`."""
    _LOG.info("%s", text, extra={"said": True})


def _text(cell: object) -> str:
    if isinstance(cell, float):
        return f"{cell:z.1f}"
    text = on_one_line(str(cell))
    return text if len(text) <= _LONGEST_CELL else f"{text[:_LONGEST_CELL]}…"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
