"""Every command with progress, on a terminal as a person sees it: in colours, without colours, and on a dumb one."""

from __future__ import annotations

import ast
import re
import shutil
import sys
from pathlib import Path

import pytest

import dbbstation
from dbbstation.cli import DONE, progress
from dbbstation.cli.demo import DemoShown
from dbbstation.cli.measure_talk import Talk
from dbbstation.plan.plan import Direction
from dbbstation.station.events import RunAccepted, RunId, RunProgress
from tests.cli.conftest import call
from tests.cli.golden_json import FIXTURES, SMALL, lines_of
from tests.cli.screen import BAR, TERMINALS, bars, share, watched

pytest.importorskip("pty", reason="needs a pseudo-terminal")

HAS_BAR = [
    "calibrate",
    "evaluate",
    "circles",
    "diagnose",
    "compare",
    "predict",
    "program",
    "report",
    "history",
    "export",
    "check",
    "identify",
    "mismatch",
    "mismatch-simulator",
    "fleet",
]
"""Commands that work by themselves; `measure` and `demo`, which run machines, are below."""

MODEL = FIXTURES / "models" / "small.yaml"
PENDULUM = FIXTURES / "simulators"
RATHER = {
    "compare": ["--no-held-out"],
    "diagnose": ["--sources", "gravity"],
    "identify": ["--no-held-out"],
    "mismatch": ["--no-held-out"],
    "mismatch-simulator": ["--most-runs", "300"],
}
"""What makes a long command short."""


@pytest.fixture(scope="module")
def lines(tmp_path_factory):
    folder = tmp_path_factory.mktemp("commands")
    found = lines_of(folder)
    shutil.copytree(SMALL.parent / "logged", folder / "many" / "logged")
    (folder / "model.yaml").write_bytes(MODEL.read_bytes())
    found["calibrate"] = ["calibrate", SMALL]
    table = (FIXTURES / "tables" / "axis.csv").read_text("utf-8").splitlines(keepends=True)
    (folder / "axis.csv").write_text("".join(table[:200]), "utf-8")
    found["mismatch"][1] = folder / "axis.csv"
    found["mismatch-simulator"] = [
        "mismatch",
        PENDULUM / "pendulum.csv",
        "--simulator",
        PENDULUM / "pendulum.yaml",
        "--no-held-out",
    ]
    found["fleet"] = ["fleet", folder / "many", "--out", folder / "fleet", "--task", "circles", "--jobs", "1"]
    found["check"] = found["check"][:-2]  # a plan and a machine: the dry run
    return {name: [*line, *RATHER.get(name, [])] for name, line in found.items()}


@pytest.fixture
def recorded(monkeypatch):
    """Bars without the moment of patience, and what was shown in them, to be shown again."""
    monkeypatch.setattr(progress, "_SHORT_S", -1.0)
    calls = []

    class Recorded(progress.ProgressBar):
        def __init__(self, *given, **named):
            super().__init__(*given, **named)
            calls.append((self, "__init__", given, named))

        def show(self, *given, **named):
            calls.append((self, "show", given, {**named, "at_once": True}))
            super().show(*given, **named)

        def end(self, **named):
            calls.append((self, "end", (), named))
            super().end(**named)

    monkeypatch.setattr(progress, "ProgressBar", Recorded)
    return calls


def again(calls):
    made = {}
    for bar, name, given, named in calls:
        if name == "__init__":
            made[bar] = Plain(*given, **named)
        else:
            getattr(made[bar], name)(*given, **named)


Plain = progress.ProgressBar


@pytest.mark.parametrize("name", HAS_BAR)
def test_a_command_shows_bars_that_can_be_read(lines, recorded, monkeypatch, tmp_path, name):
    monkeypatch.setattr("dbbstation.simulators.kept.simulations_folder", lambda: tmp_path / "kept")
    outcomes = []
    seen = watched(lambda: outcomes.append(call(*lines[name], err=sys.stderr).code), monkeypatch)
    assert outcomes == [DONE], "\n".join(seen.last)
    assert bars(seen.last)
    assert seen.coloured
    reads_well(seen)
    without = watched(lambda: again(recorded), monkeypatch, "no-color")
    assert not without.coloured
    reads_well(without)
    dumb = watched(lambda: again(recorded), monkeypatch, "dumb")
    assert b"\x1b" not in dumb.raw
    assert b"\r" not in dumb.raw.replace(b"\r\n", b"")
    reads_well(dumb)
    # Whatever the terminal, in the end the same bars are full.
    full = [[(bar[1], share(bar)) for bar in bars(screen.last)] for screen in (seen, without, dumb)]
    assert full[0] == full[1] == full[2]
    assert {done for _, done in full[0]} == {1.0}


def reads_well(seen):
    """No character that is written as a code, no piece of a bar, no bar twice on a screen."""
    assert b"\\x" not in seen.raw
    for screen in seen.screens:
        drawn = [line for line in screen if "━" in line]
        assert all(BAR.match(line) for line in drawn), drawn
        labels = [bar[1] for bar in bars(drawn) if share(bar) < 1.0]
        assert len(labels) == len(set(labels)) <= 1, drawn


def test_no_command_with_progress_is_left_out():
    folder = Path(dbbstation.__file__).parent / "cli"
    using = {
        path.stem
        for path in folder.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module == "dbbstation.cli.progress"
    }
    named = {name.replace("-", "_") for name in HAS_BAR}
    declared = {p.stem for p in folder.glob("*.py") if re.search("cli.declared import .*command", p.read_text("utf-8"))}
    shown = named - {"mismatch_simulator", "program"} | {"demo", "measure_talk", "programs", "__init__", "declared"}
    assert using | declared - {"simulate"} == shown  # compiling is shown by every command


RUN = RunId("a", Direction.CCW, 1, 1)


@pytest.mark.parametrize("terminal", TERMINALS)
def test_measuring_shows_one_bar_which_leaves_with_the_circle(monkeypatch, terminal):
    def work():
        talk = Talk(asking=False)
        for number in range(3):
            for swept in range(0, 401, 20):
                talk(RunProgress(RUN, float(swept), 400.0))
            talk(RunAccepted(RUN, f"{number}"))
        talk.end()

    seen = watched(work, monkeypatch, terminal)
    reads_well(seen)
    assert seen.last == ["  a-ccw-1 accepted"] * 3
    shown = [bar for screen in seen.screens for bar in bars(screen)]
    assert bool(shown) == (terminal != "dumb")
    assert {(bar[1], bar[4]) for bar in shown} <= {("recording", "400")}


@pytest.mark.parametrize("terminal", TERMINALS)
def test_the_demonstration_shows_its_commands_and_a_bar_for_each(monkeypatch, terminal):
    def work():
        shown = DemoShown()
        shown.tell("dbbstation measure")
        for number in range(30):
            shown.progress("test a ccw", number, 30)
        shown.tell("dbbstation calibrate")
        shown.bar.end()

    seen = watched(work, monkeypatch, terminal)
    assert b"\\x" not in seen.raw
    assert seen.last == ["$ dbbstation measure", "$ dbbstation calibrate"]
    shown = [bar for screen in seen.screens for bar in bars(screen)]
    assert bool(shown) == (terminal != "dumb")
    assert {(bar[1], bar[4], bar[7]) for bar in shown} <= {("circles", "30", "test a ccw")}
