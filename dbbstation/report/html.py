"""Make pages as one HTML file; the template engine escapes all text."""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from typing import TYPE_CHECKING

import jinja2

from dbbstation.report.history_words import DASH, rounded
from dbbstation.text.digits import with_uncertainty

if TYPE_CHECKING:
    from dbbstation.report.shown import ReportContent
    from dbbstation.results.report import ReportResult


def report_html(numbers: ReportResult, content: ReportContent) -> bytes:
    """Return a reproducible report without external references.

    Its one script enlarges polar traces; its policy forbids other scripts.
    """
    script = files("dbbstation.report").joinpath("templates", "polar.js").read_text("utf-8").strip()
    digest = b64encode(sha256(script.encode()).digest()).decode()
    page = environment().get_template("report.html")
    shown = {**vars(numbers), **vars(content)}
    return page.render(shown, script=script, script_sha256=digest).encode()


def environment() -> jinja2.Environment:
    """Return the template engine: texts are escaped, missing names are errors."""
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("dbbstation.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters["um"] = _um
    made.filters["css"] = _css
    made.filters["with_u"] = with_uncertainty
    made.filters["figure"] = rounded
    return made


def _css(text: str) -> str:
    """Return a text for a string of a style sheet: all characters except letters, digits and blanks become numbers."""
    return "".join(c if c.isalnum() or c == " " else f"\\{ord(c):x} " for c in text)


def _um(value: float | None, decimals: int = 1) -> str:
    if value is None:
        return DASH
    return f"{round(value, decimals) + 0.0:.{decimals}f}"
