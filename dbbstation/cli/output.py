"""Output of commands: data and figures of circles on standard output, messages on standard error."""

from __future__ import annotations

import json
import logging
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from dbbstation import __version__
from dbbstation.files.places import name_of
from dbbstation.text.written import on_one_line, printable, words

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from dbbstation.calibration.reporting.evaluation import EvaluatedRun, EvaluatedTolerance, WorstRun
    from dbbstation.files.provenance import Provenance
    from dbbstation.report.figure_format import Stamped


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
    from dbbstation.cli.output import provenance

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


def print_table(titles: str | Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows under titles, numbers aligned right, texts left.

    Args:
        titles: one each, or one text with commas between.
    """
    texts = [[_text(cell) for cell in row] for row in rows]
    titles = words(titles) if isinstance(titles, str) else titles
    columns = list(zip(titles, *texts, strict=True))
    numeric = [all(_is_number(text) for text in column[1:] if text) for column in columns]
    widths = [max(map(len, column)) for column in columns]
    for row in [list(titles), *texts]:
        cells = [c.rjust(w) if n else c.ljust(w) for c, w, n in zip(row, widths, numeric, strict=True)]
        echo("  ".join(cells).rstrip())


def say(text: str) -> None:
    """Print a note and log it, on one line even if names contain line ends."""
    log_said(text)
    echo(on_one_line(text), err=True)


def echo_each(texts: Iterable[str]) -> None:
    """Print texts, each from a new line."""
    for text in texts:
        echo(text)


def echo_line(text: str) -> None:
    """Print text on one line, even with line ends in names."""
    echo(on_one_line(text))


def log_said(text: str) -> None:
    """Log a text that the user sees anyway, hidden from `--verbose`."""
    _LOG.info("%s", text, extra={"said": True})


def _text(cell: object) -> str:
    if isinstance(cell, float):
        return f"{cell:z.1f}"
    text = on_one_line("" if cell is None else str(cell))
    return text if len(text) <= _LONGEST_CELL else f"{text[:_LONGEST_CELL]}…"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def format_of(path: Path) -> Stamped:
    """Return the format of a path with its provenance."""
    from dbbstation.report.figure_format import FigureFormat, Stamped

    return Stamped(FigureFormat(path.suffix.lower()), provenance())


def known_format(path: Path) -> Path:
    """Return a path after checking its extension, before any work.

    Raises:
        ValueError: the name ends otherwise.
    """
    from dbbstation.report.figure_format import FigureFormat

    if path.suffix.lower() not in set(FigureFormat):
        ending = f"`{path.suffix}` is no format of figures" if path.suffix else f"`{path.name}` has no ending"
        raise ValueError(f"{ending}; let the name end in {', '.join(FigureFormat)}")
    return path


G_WITH_NOISE = "G: greatest minus least deviation from the least-squares circle [ISO 230-4], the bar's noise included"
G_LOW_PASSED = (
    "G: greatest minus least deviation from the least-squares circle [ISO 230-4], readings low-passed at 30 undulations "
    "per revolution"
)
"""Two definitions of circular deviation G in tables. In a good circle the first is mostly noise, about six times its
standard deviation. Only the second is comparable with a prediction, which has no noise."""


def print_runs(runs: Sequence[EvaluatedRun], *, low_passed: bool = False) -> None:
    """Print centre deviation, mean radial error and circular deviation of every run, before and after."""
    echo("             centre deviation     mean radial error  circular deviation G  [µm]")
    titles = ["test", "dir", "n", "before", "after", " before", " after", "  before", "  after"]
    rows = []
    for run in runs:
        both = (run.before, run.after)
        bent = [of.circularity_um for of in both]
        if low_passed and run.circularity_30_upr_um is not None:
            bent = [run.circularity_30_upr_um.before, run.circularity_30_upr_um.after]
        rows.append(
            [
                *run.key,
                *(of.centre_deviation_um for of in both),
                *(of.mean_radial_error_um for of in both),
                *bent,
            ]
        )
    print_table(titles, rows)
    echo(G_LOW_PASSED if low_passed else G_WITH_NOISE)


def which_circles(tests: Sequence[str], directions: Sequence[str]) -> str:
    """Return the circles of a tolerance: no test means all, no direction both."""
    named = f"tests {', '.join(tests)}" if tests else "every test"
    return named + (f", {', '.join(directions)} only" if directions else "")


def print_tolerances(held: Sequence[EvaluatedTolerance], origin: str) -> None:
    """Print the worst run of every tolerance."""
    if not held:
        return
    echo(
        f"\ntolerances [µm], from {origin}; the worst run of each, readings under the nominal machine and under the model"
    )
    rows = []
    for one in held:
        worst = [_told(each) for each in (one.before, one.after)]
        rows.append(
            [
                one.quantity,
                which_circles(one.tests, one.directions),
                f"{one.largest_um:g}",
                *(t for pair in worst for t in pair),
            ]
        )
    print_table("quantity, circles, at most, nominal machine, , model, ", rows)


def _told(worst: WorstRun | None) -> tuple[str, str]:
    if worst is None:
        return "-", "no such run"
    return f"{worst.worst_um:.1f}", f"{worst.run}, {'within' if worst.within else 'EXCEEDED'}"


PROGRAM = f"dbbstation {__version__}"

_NO_CONTENT = frozenset(words("out, table, allow, page, pdf, figure, log, force, as_json, jobs, scheduler, anew"))
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
