"""Make pages as one HTML file, and print them as PDF; the template engine escapes all text."""

from __future__ import annotations

import os
import shutil
import tempfile
from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import jinja2

from dbbstation.errors import StationError
from dbbstation.facts.digits import with_uncertainty
from dbbstation.report.history_words import DASH, rounded
from dbbstation.system.children import BoundExceededError, ProgramBounds, is_root, run_bounded

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.results.report import ReportResult


def report_html(numbers: ReportResult, content: Mapping[str, object]) -> bytes:
    """Return a reproducible report without external references.

    Its one script enlarges polar traces; its policy forbids other scripts.
    """
    script = files("dbbstation.report").joinpath("templates", "polar.js").read_text("utf-8").strip()
    digest = b64encode(sha256(script.encode()).digest()).decode()
    page = environment().get_template("report.html")
    return page.render({**vars(numbers), **content}, script=script, script_sha256=digest).encode()


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


BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
"""Names of an installed Chromium on the PATH."""

BROWSER_VARIABLE = "DBBSTATION_CHROMIUM"
"""Environment variable with the path of another Chromium."""

BOUNDS = ProgramBounds(time_s=120.0, memory_mb=8000.0, output_mb=1000.0)
"""Bounds of the browser: a report of a hundred runs prints in seconds; a browser that needs longer hangs."""


def chromium() -> str:
    """Return the path of the Chromium.

    Raises:
        StationError: none is installed.
    """
    named = os.environ.get(BROWSER_VARIABLE)
    found = next((path for name in ((named,) if named else BROWSERS) if (path := shutil.which(name))), None)
    if found is None:
        what = (
            f"{named}, which {BROWSER_VARIABLE} names, is no program"
            if named
            else "no Chromium is installed to print a PDF"
        )
        remedy = (
            "install Chromium (Debian: apt install chromium; Windows: Edge is one), name one in "
            f"{BROWSER_VARIABLE}, or open the HTML file in any browser and print it"
        )
        raise StationError(what, where="--pdf", remedy=remedy)
    return found


def printed(html: bytes, browser: str) -> bytes:
    """Return a report as PDF.

    Raises:
        StationError: the browser fails, with its last message.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page, out = Path(folder) / "report.html", Path(folder) / "report.pdf"
        page.write_bytes(html)
        command = [
            browser,
            "--headless",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--user-data-dir={folder}/profile",
        ]
        if is_root():
            command.append("--no-sandbox")  # as root it does not start with one; the page has no script
        command += [f"--print-to-pdf={out}", page.as_uri()]
        try:
            done = run_bounded(command, Path(folder), BOUNDS)
        except (OSError, BoundExceededError) as error:
            raise StationError(f"the browser did not print: it {error}", where=browser, remedy=_BY_HAND) from error
        if not out.is_file():
            said = done.said.strip().splitlines()[-1:] or [f"exit code {done.code}"]
            raise StationError(f"the browser did not print: {said[0]}", where=browser, remedy=_BY_HAND)
        return out.read_bytes()


_BY_HAND = "open the HTML file in any browser and print it"
