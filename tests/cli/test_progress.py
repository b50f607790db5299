"""Progress of a diagnosis: a bar on a terminal, lines elsewhere, and an end that leaves the terminal as it was."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stderr, suppress
from pathlib import Path

import click
import pytest

from dbbstation.cli import DONE, FAILED
from dbbstation.cli.diagnose import STAGES
from dbbstation.cli.progress import stage_bar

pty = pytest.importorskip("pty", reason="needs a pseudo-terminal")

SESSION = Path(__file__).parents[2] / "fixtures" / "sessions" / "small"
PROGRAM = [sys.executable, "-m", "dbbstation", "diagnose", str(SESSION), "--sources", "gravity,backlash"]
PATIENCE_S = 120.0
SHOW_CURSOR = "\x1b[?25h"


def on_terminal(work: Callable[[], None]) -> list[str]:
    """What a terminal gets from work whose standard error it is, split where the line begins anew."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w", buffering=1) as screen, redirect_stderr(screen):
        work()
        screen.write("\0")
        screen.flush()
        shown = b""
        while not shown.endswith(b"\0"):
            shown += os.read(ours, 4096)
    os.close(ours)
    return shown.decode().rstrip("\0").replace("\n", "").split("\r")


def percents(lines: list[str]) -> list[int]:
    return [int(line.partition("%")[0].rpartition(" ")[2]) for line in lines if "%" in line]


def test_the_bar_never_goes_back_and_ends_full(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    told = [
        "kinematic calibration",
        "candidates",
        *["joint fit with " + "gravity, " * 9] * 5,
        "candidates",
        "what else",
    ]
    told += ["joint fit with backlash", "verdicts", "held-out tests", "next test"]

    def work() -> None:
        with stage_bar("diagnosis", STAGES) as tell:
            for text in told:
                tell(text)

    lines = on_terminal(work)
    seen = percents(lines)
    assert seen == sorted(seen)
    assert seen[-1] == 100
    assert {10, 45, 75, 77, 80} <= set(seen)
    # Joint fits are as many as it takes: they come closer to the verdicts and never reach them.
    assert all(p < 75 for line, p in zip([x for x in lines if "%" in x], seen, strict=True) if "joint fit" in line)
    assert all(any(text[:20] in line for line in lines) for text in told)
    assert 60 < max(len(re.sub(r"\x1b\[[?0-9]*[a-zA-Z]", "", line)) for line in lines) < 80
    assert "".join(lines).endswith(SHOW_CURSOR)


def test_nothing_told_is_no_bar():
    def work() -> None:
        with stage_bar("diagnosis", STAGES):
            click.echo("note", err=True)

    assert on_terminal(work) == ["note", ""]


def test_plain_is_lines_on_a_terminal_too():
    def work() -> None:
        with stage_bar("diagnosis", STAGES, plain=True) as tell:
            tell("candidates")

    assert on_terminal(work) == ["... candidates", ""]


def test_in_a_pipe_are_lines(run):
    outcome = run(*PROGRAM[3:])
    assert outcome.code == DONE
    assert [line for line in outcome.err.splitlines() if line.startswith("...")] == [
        f"... {stage}" for stage in STAGES if stage != "joint fit"
    ]
    assert "\r" not in outcome.err


def in_terminal(*, interrupt: bool) -> tuple[int, str]:
    """Run the command with standard error on a terminal; interrupted as soon as the bar is there, or to its end."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(PROGRAM, stdout=subprocess.DEVNULL, stderr=theirs)
    os.close(theirs)
    said, end_s = "", time.monotonic() + PATIENCE_S
    with suppress(OSError):  # the other end is closed: it is over
        while time.monotonic() < end_s:
            came = os.read(ours, 4096).decode()
            if not came:
                break
            said += came
            if interrupt and "candidates" in said:
                process.send_signal(signal.SIGINT)
                interrupt = False
    os.close(ours)
    return process.wait(PATIENCE_S), said


def test_a_terminal_has_a_bar():
    code, said = in_terminal(interrupt=False)
    assert code == DONE
    assert percents(said.split("\r"))[-1] == 100
    assert "..." not in said
    # What was noticed in the files stands on a line of its own.
    assert said.splitlines()[0] == "note: small: run l cw 2 is recording, not accepted: left out"


def test_ctrl_c_ends_the_bar_and_says_so():
    code, said = in_terminal(interrupt=True)
    assert code == FAILED
    assert "Traceback" not in said
    bar, told = said.rsplit(SHOW_CURSOR, 1)
    assert "candidates" in bar
    assert told.strip() == "interrupted; what was written before stays"
