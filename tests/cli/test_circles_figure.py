"""`dbbstation circles --figure`: files of each format, what the title block says, what is refused."""

from __future__ import annotations

import re
import shutil
from xml.etree import ElementTree as ET

import pytest

from dbbstation import __version__
from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.files.places import shipped_folder
from tests.cli.conftest import call
from tests.cli.test_figure_options import BEGINS

SMALL = shipped_folder("fixtures") / "sessions" / "small"
EVIL = "<script>alert(1)</script> & $x_1$"


def words_of(path):
    root = ET.fromstring(path.read_bytes())  # noqa: S314 - our own file
    assert not [one for one in root.iter() if one.tag.endswith("}script")]
    return [one.text for one in root.iter("{http://www.w3.org/2000/svg}text") if one.text]


@pytest.fixture
def small(tmp_path):
    folder = tmp_path / "small"
    shutil.copytree(SMALL, folder)
    return folder


def edited(folder, pattern, replacement, name="session.yaml"):
    path = folder / name
    text, count = re.subn(pattern, replacement, path.read_text("utf-8"), flags=re.MULTILINE)
    assert count
    path.write_text(text, "utf-8")


@pytest.mark.parametrize("kind", ["polar", "deviation", "spectrum", "map"])
def test_the_title_block_says_what_the_session_says(kind, tmp_path):
    out = tmp_path / "figure.svg"
    outcome = call("circles", SMALL, "--tests", "a,g", "--kind", kind, "--filter", "50", "--figure", out)
    assert outcome.code == DONE, outcome.err
    said = " ".join(words_of(out))
    for told in ("PM600-0007", "first shift", "DBB-0042", "2026-11-20 08:00", "Gaussian, 50 UPR", __version__):
        assert told in said


@pytest.mark.parametrize(
    ("tests", "kind", "dates"),
    [
        ("g", "polar", "2026-11-20 08:09 to 2026-11-20 08:12 UTC"),
        ("a,l", "map", "2026-11-20 08:00 to 2026-11-20 08:18 UTC"),
    ],
)
def test_dates_are_those_of_the_runs_that_are_drawn(tests, kind, dates, tmp_path):
    outcome = call("circles", SMALL, "--tests", tests, "--kind", kind, "--figure", tmp_path / "figure.svg")
    assert outcome.code == DONE, outcome.err
    assert f"measured {dates}" in " ".join(words_of(tmp_path / "figure.svg"))


def test_a_single_run_has_one_date(small, tmp_path):
    edited(small, r"(test: g, direction: cw.*state: )accepted", r"\1rejected")
    outcome = call("circles", small, "--tests", "g", "--figure", tmp_path / "figure.svg")
    assert outcome.code == DONE, outcome.err
    assert "measured 2026-11-20 08:09 UTC bar" in " ".join(words_of(tmp_path / "figure.svg"))


@pytest.mark.parametrize("ending", [".png", ".pdf", ".PDF"])
def test_the_ending_says_the_format(tmp_path, ending):
    out = tmp_path / f"figure{ending}"
    arguments = ("circles", SMALL, "--tests", "a", "--figure", out)
    assert call(*arguments).code == DONE
    first = out.read_bytes()
    assert first.startswith(BEGINS[ending.lower()])
    refused = call(*arguments)
    assert refused.code == FAILED
    assert "--force" in refused.err
    assert call(*arguments, "--force").code == DONE
    assert out.read_bytes() == first
    assert call("circles", SMALL, "--figure", tmp_path / "figure.jpg").code == USAGE


def test_sessions_are_compared(small, tmp_path):
    out = tmp_path / "both.svg"
    other = small.rename(tmp_path / "other")
    assert call("circles", SMALL, other, "--tests", "a", "--kind", "compare", "--figure", out).code == DONE
    said = words_of(out)
    assert {"small: test a", "other: test a"} <= set(said)
    alone = call("circles", SMALL, "--kind", "compare", "--figure", tmp_path / "one.svg")
    assert alone.code == USAGE
    assert "name two sessions or more" in alone.err


def test_a_test_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    outcome = call("circles", SMALL, "--tests", "z", "--figure", tmp_path / "z.svg")
    assert outcome.code == FAILED
    assert "no session has a test z" in outcome.err
    assert "tests are a, g, l" in outcome.err
    assert not (tmp_path / "z.svg").exists()


def test_one_direction_is_drawn_and_said(small, tmp_path):
    edited(small, r"(test: g, direction: cw.*state: )accepted", r"\1rejected")
    out = tmp_path / "g.svg"
    outcome = call("circles", small, "--tests", "g", "--figure", out, "--json")
    assert outcome.code == DONE
    assert outcome.data["pairs"] == []
    said = words_of(out)
    assert "test g: CCW only" in said
    assert "clockwise (CW)" not in said


@pytest.mark.parametrize("kept", [1, 8])
def test_a_run_of_few_samples_is_refused_with_its_reason(small, tmp_path, kept):
    for name in ("g-ccw-1", "g-cw-1"):
        path = small / "runs" / f"{name}.csv"
        lines = path.read_text("utf-8").splitlines()
        head = next(k for k, line in enumerate(lines) if line.startswith("t_s"))
        path.write_text("\n".join(lines[: head + 1 + kept]) + "\n", "utf-8")
    edited(small, r"(test: g, .*), sha256: [0-9a-f]{64}", r"\1")
    outcome = call("circles", small, "--tests", "g", "--figure", tmp_path / "g.svg")
    assert outcome.code == FAILED
    assert "g" in outcome.err
    assert "fault of dbbstation" not in outcome.err
    assert not (tmp_path / "g.svg").exists()


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_what_people_typed_is_text(small, tmp_path, ending):
    edited(small, r"^operator:.*$", f"operator: '{EVIL} 安'")
    edited(small, r"^name:.*$", f"name: '{EVIL}'", "plan.yaml")
    out = tmp_path / f"evil.{ending}"
    outcome = call("circles", small, "--tests", "a", "--figure", out)
    assert outcome.code == DONE, outcome.err
    assert "Glyph" not in outcome.err
    if ending == "svg":
        assert "<script" not in out.read_text("utf-8")
        assert "<script>alert(1)</script> & $x_1$" in " ".join(words_of(out))
