"""Print a report as PDF with an installed Chromium."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from dbbstation.errors import StationError
from dbbstation.system.children import BoundExceededError, ProgramBounds, is_root, run_bounded

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
