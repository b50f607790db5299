"""Terminal, HTML and screen say the same of one session, sentence by sentence."""

from __future__ import annotations

import html
import re

import pytest

from dbbstation.cli import DONE
from dbbstation.files.places import shipped_folder
from dbbstation.service.work import SessionTask
from dbbstation.tui import texts
from dbbstation.tui.results_screen import result_lines

pytestmark = pytest.mark.usefixtures("answers_kept")

SMALL = shipped_folder("fixtures") / "sessions" / "small"
SETTINGS = """format: dbb-settings/1
tolerances:
  - {quantity: circular-deviation, largest: 8.0, unit: µm}
"""
OF_THE_SCREEN = (*texts.VERDICT_WORDS.values(), *texts.REPORT_VERDICT.values())
"""Words that stand in a table or a colour elsewhere: a verdict's heading, PASS and FAIL."""


def both(run, task, *arguments):
    """Sentences on the screen that have no heading of its own, and everything on the terminal."""
    answered = run(*arguments, "--json")
    printed = run(*arguments, "--force") if "--page" in arguments else run(*arguments)
    assert (answered.code, printed.code) == (DONE, DONE), printed.err
    shown = [line.strip() for line in result_lines(task, answered.data)]
    return [line for line in shown if not line.startswith(OF_THE_SCREEN)], printed.out + printed.err


@pytest.mark.parametrize(
    ("command", "task"), [("calibrate", SessionTask.CALIBRATE), ("diagnose", SessionTask.DIAGNOSE)]
)
@pytest.mark.slow
def test_what_the_screen_says_the_terminal_says(run, command, task):
    shown, terminal = both(run, task, command, SMALL)
    assert len(shown) > 2
    assert [line for line in shown if line not in terminal] == []


@pytest.mark.slow
def test_page_terminal_and_screen_say_the_same(run, tmp_path):
    model, page, settings = tmp_path / "model.yaml", tmp_path / "report.html", tmp_path / "settings.yaml"
    settings.write_text(SETTINGS, encoding="utf-8")
    fitted = run("calibrate", SMALL, "--out", model)
    line = ["--settings", settings, "report", SMALL, "--model", model, "--page", page]
    shown, terminal = both(run, SessionTask.REPORT, *line)
    text = html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", page.read_text("utf-8"))))
    assert [one for one in shown if one not in terminal] == []
    assert [one for one in shown if one.replace("`", "") not in text] == []  # a page sets commands in their own type
    unseen = [one for one in fitted.out.splitlines() if one.startswith(("not visible", "least visible"))]
    assert unseen
    assert [one for one in unseen if one not in text] == []
