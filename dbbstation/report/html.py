"""Pages as one HTML file: everything that is not markup is escaped by the template engine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jinja2

from dbbstation.history.words import DASH, rounded

if TYPE_CHECKING:
    from collections.abc import Mapping


def report_html(content: Mapping[str, Any]) -> bytes:
    """Return a report as HTML: one file without script that refers to nothing outside it, the same for the same content.

    Args:
        content: what `content_of` returns.
    """
    return environment().get_template("report.html").render(content).encode()


def environment() -> jinja2.Environment:
    """Return the template engine of every page: what a text holds is escaped, a name that is not given is an error."""
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("dbbstation.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters["um"] = _um
    made.filters["figure"] = rounded
    return made


def _um(value: float | None, decimals: int = 1) -> str:
    """Return a length with its decimals, zero without a sign; a dash where there is none."""
    if value is None:
        return DASH
    return f"{round(value, decimals) + 0.0:.{decimals}f}"
