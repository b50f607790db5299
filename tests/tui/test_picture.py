"""The picture in the documentation is made by its script."""

from __future__ import annotations

import importlib.util
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_the_script_makes_the_picture() -> None:
    spec = importlib.util.spec_from_file_location("station_picture", DOCS / "station_picture.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    svg = script.picture()
    for text in ("Ten-minute&#160;check", "low-cw-1", "on&#160;the&#160;circle", "accepted", "running", "⣿"):
        assert text in svg
    assert len(svg) < 150_000


def test_the_pictures_are_shown() -> None:
    text = (DOCS / "screen.md").read_text("utf-8")
    for name in ("station", "station-overview", "station-large"):
        assert (DOCS / "images" / f"{name}.svg").read_text("utf-8").startswith("<svg")
        assert f"images/{name}.svg" in text
