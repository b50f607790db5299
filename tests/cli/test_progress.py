"""Progress of a diagnosis: a bar on a terminal, lines elsewhere, and an end that leaves the terminal as it was."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import click
import numpy as np
import pyte
import pytest

from dbbstation.cli import DONE, FAILED, progress
from dbbstation.cli.output import say
from dbbstation.cli.progress import count_bar, stage_bar, time_left
from dbbstation.errors import KinematicsError
from dbbstation.files.places import shipped_folder
from dbbstation.model import identified as uncertainty
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources
from dbbstation.tasks.diagnose import STAGES
from tests.cli.screen import COLUMNS, ROWS, bars, watched
from tests.copied import started

pty = pytest.importorskip("pty", reason="needs a pseudo-terminal")

MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
SESSION = Path(__file__).parents[2] / "fixtures" / "sessions" / "small"
PROGRAM = [sys.executable, "-m", "dbbstation", "diagnose", str(SESSION), "--sources", "gravity,backlash"]
PATIENCE_S = 120.0


def percents(seen):
    return [int(bar[5]) for lines in seen.screens for bar in bars(lines) if bar[5]]


def test_the_bar_never_goes_back_and_ends_full(monkeypatch):
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
                time.sleep(0.02)  # the screen is looked at between two stages

    seen = watched(work, monkeypatch)
    found = percents(seen)
    assert found == sorted(found)
    assert found[-1] == 100
    assert {10, 45, 75, 77, 80} <= set(found)
    # Joint fits are as many as it takes: they come closer to the verdicts and never reach them.
    shown = [bar for lines in seen.screens for bar in bars(lines)]
    assert all(int(bar[5]) < 75 for bar in shown if bar[7].startswith("joint fit"))
    assert all(any(bar[7].startswith(text[:20]) for bar in shown) for text in told)
    # What is too long for the line is cut; there is room for the ^C of Ctrl-C behind it.
    assert max(len(line) for lines in seen.screens for line in lines) == COLUMNS - 3
    assert any(bar[7].endswith("…") for bar in shown)
    assert len(seen.last) == 1


def test_nothing_told_is_no_bar(monkeypatch):
    def work() -> None:
        with stage_bar("diagnosis", STAGES):
            click.echo("note", err=True)

    assert watched(work, monkeypatch).last == ["note"]


def test_lines_that_are_said_meanwhile_stand_above_the_bar(monkeypatch):
    def work() -> None:
        with stage_bar("diagnosis", STAGES) as tell:
            tell("candidates")
            say("note: [small] has \x1b[2J in it")
            tell("verdicts")

    last = watched(work, monkeypatch).last
    assert last[0] == r"note: [small] has \x1b[2J in it"
    assert bars(last[1:])[0][5] == "100"
    assert len(last) == 2


def test_compiling_is_said_once_with_a_bar_that_goes(monkeypatch):
    def work() -> None:
        told = progress.Compiling()
        for _ in range(2):
            told(True)  # noqa: FBT003 - as the compiler tells it
            told(False)  # noqa: FBT003

    seen = watched(work, monkeypatch)
    assert seen.last == ["compiling the numerical loops, once on this computer: up to half a minute"]
    assert any(line.startswith("compiling ━") for lines in seen.screens for line in lines)


SOME_KERNEL = """
import sys
from dbbstation.computing.compiled import tell_of_compiling
from dbbstation.computing.compiled import compiled
told = []
tell_of_compiling(told.append)
def twice(x):
    return 2.0 * x
kernel = compiled(twice)
assert kernel(1.0) == kernel(1.0) == 2.0
print(told)
"""


def test_whoever_asks_is_told_of_a_loop_that_is_compiled_and_not_of_one_that_is_kept(tmp_path):
    script = tmp_path / "some.py"
    script.write_text(SOME_KERNEL)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    said = [
        subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert said == ["[True, False]\n", "[]\n"]


def test_in_a_pipe_is_nothing(run):
    outcome = run(*PROGRAM[3:])
    assert outcome.code == DONE
    assert outcome.err.splitlines() == ["note: small: run l cw 2 is recording, not accepted: left out"]


def test_verbose_shows_the_stages_as_lines(run):
    outcome = run(*PROGRAM[3:], "--verbose")
    assert outcome.code == DONE
    assert [line for line in outcome.err.splitlines() if line.startswith("log: ...")] == [
        f"log: ... {stage}" for stage in STAGES if stage != "joint fit"
    ]
    assert "\r" not in outcome.err


class Clock:
    """Time that passes when it is told to."""

    def __init__(self, monkeypatch):
        self.now_s = 100.0
        monkeypatch.setattr(progress, "now_s", lambda: self.now_s)


def test_a_count_shows_how_many_of_how_many_and_ends_its_line(monkeypatch):
    clock = Clock(monkeypatch)

    def work() -> None:
        with count_bar("reading runs") as tell:
            for done in range(31):
                tell(done, 30)
                clock.now_s += 0.4
            click.echo("note", err=True)

    last = watched(work, monkeypatch).last
    bar = bars(last)[0]
    assert (bar[1], bar[3], bar[4]) == ("reading runs", "30", "30")
    # What is said after the last run stands on a line of its own.
    assert last[1:] == ["note"]


def test_what_is_over_at_once_shows_no_bar(monkeypatch):
    def work() -> None:
        with count_bar("reading runs") as tell:
            for done in range(31):
                tell(done, 30)

    assert watched(work, monkeypatch).raw == b""


def test_counts_move_within_their_stage_and_say_what_is_left(monkeypatch):
    clock = Clock(monkeypatch)

    def work() -> None:
        with stage_bar("prediction", {"reading": 0, "predicting": 50, "writing": 90}) as tell:
            tell("reading poses")
            clock.now_s += 10.0
            for done in range(5):
                tell("predicting pose", done, 4)
                time.sleep(0.5)  # counts are drawn five times a second
                clock.now_s += 5.0
            tell("writing")

    seen = watched(work, monkeypatch)
    at = {bar[7]: (bar[5], bar[6]) for lines in seen.screens for bar in bars(lines)}
    # Ten seconds for half of the work: ten are left. Half of the next 40 % after ten more: 20 s for 70 %.
    assert at["predicting pose 0 of 4"] == ("50", "10")
    assert at["predicting pose 2 of 4"] == ("70", "9")
    assert percents(seen) == sorted(percents(seen))


@pytest.mark.parametrize(
    ("share", "passed_s", "text"),
    [
        (0.5, 10.0, "10 s left, "),
        (0.1, 60.0, "9 min left, "),
        (0.5, 2.0, ""),
        (0.01, 100.0, ""),
        (1.0, 50.0, ""),
    ],
)
def test_what_is_left(share, passed_s, text):
    assert time_left(share, passed_s) == text


def test_poses_are_predicted_alike_in_pieces_and_at_once(monkeypatch, reference):
    rng = np.random.default_rng(4)
    poses = np.column_stack(
        [rng.uniform(-80, 80, (23, 2)), rng.uniform(-1050, -950, 23), rng.uniform(-5, 5, (23, 2)), np.zeros(23)]
    )
    known = known_sources()
    model = MachineModel(reference, (Fitted(known["strut-reference-length"], rng.normal(0, 0.05, 6)),))
    rows = tuple(("strut-reference-length", "", p.name) for p in known["strut-reference-length"].parameters(reference))
    identified = IdentifiedModel(model, rows, 1e-8 * np.eye(6))
    monkeypatch.setattr(uncertainty, "POSES_AT_ONCE", 5)
    told = []
    actual, u_mm = uncertainty.predicted_poses(identified, poses, lambda done, of: told.append((done, of)))
    assert told == [(0, 23), (5, 23), (10, 23), (15, 23), (20, 23), (23, 23)]
    np.testing.assert_array_equal(actual, model.actual_poses(Motion(poses)))
    np.testing.assert_allclose(u_mm, uncertainty.position_uncertainty_mm(identified, Motion(poses)), rtol=1e-12)
    poses[17, 2] = 5_000.0  # above the machine: the struts do not reach, and the actual pose is nowhere
    monkeypatch.setattr(
        MachineModel,
        "actual_poses",
        lambda _, motion: _fail_above(motion.poses),
    )
    with pytest.raises(KinematicsError, match="pose 18"):
        uncertainty.predicted_poses(identified, poses)


def _fail_above(poses):
    if (poses[:, 2] > 0).any():
        raise KinematicsError("no pose", where=f"pose {int(np.argmax(poses[:, 2] > 0)) + 1}")
    return poses


INTERRUPTED = {
    "calibrate": ["calibrate", "SESSION", "--out", "model.yaml", "--force"],
    "evaluate": ["evaluate", "SESSION", "--model", MODEL],
    "predict": ["predict", "--model", MODEL, "poses.csv", "--table", "out.csv"],
    "study": ["coverage", "--machines", "50"],
    "program": ["program", "--plan", PLAN, "--machine", MACHINE, "--model", MODEL, "--out", "nc"],
}


@pytest.mark.nightly  # what a signal hits after a time depends on the computer: during Python's own imports it is theirs to answer
@pytest.mark.parametrize("name", INTERRUPTED)
@pytest.mark.parametrize("after_s", [1.5, 4.0])
def test_ctrl_c_ends_with_one_line_and_leaves_whole_files(tmp_path, name, after_s):
    shutil.copytree(SESSION, tmp_path / "session")
    rows = "0,0,-1008,0,0,0\n" * 200_000
    (tmp_path / "poses.csv").write_text(f"x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n{rows}")
    (tmp_path / "model.yaml").write_text("what was there before")
    words = [{"SESSION": "session"}.get(word, str(word)) for word in INTERRUPTED[name]]
    before = set(tmp_path.rglob("*"))
    process = subprocess.Popen(
        [sys.executable, "-m", "studies" if name == "study" else "dbbstation", *words],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )
    time.sleep(after_s)
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGINT)
    printed, said = process.communicate(timeout=PATIENCE_S)
    if process.returncode == DONE or (process.returncode == -signal.SIGINT and printed):
        pytest.skip("it was over before")
    assert process.returncode == FAILED, said
    told = [line for line in said.splitlines() if not line.startswith("note: ")]  # notes of the files come before
    assert told == ["interrupted; files that were already written are kept"]
    assert set(tmp_path.rglob("*")) == before
    assert (tmp_path / "model.yaml").read_text() == "what was there before"


def in_terminal() -> tuple[int, str]:
    """Run the command with standard error on a terminal, and interrupt it as soon as the bar is there."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "COLUMNS": str(COLUMNS), "TERM": "xterm"}
    process = started(PROGRAM[3:], stdout=subprocess.DEVNULL, stderr=theirs, env=environment)
    os.close(theirs)
    said, end_s = b"", time.monotonic() + PATIENCE_S
    interrupt = True
    with suppress(OSError):  # the other end is closed: it is over
        while time.monotonic() < end_s:
            came = os.read(ours, 4096)
            if not came:
                break
            said += came
            if interrupt and b"candidates" in said:
                process.send_signal(signal.SIGINT)
                interrupt = False
    os.close(ours)
    return process.wait(PATIENCE_S), said.decode()


@pytest.mark.usefixtures("copies")
def test_ctrl_c_ends_the_bar_and_says_so():
    code, said = in_terminal()
    assert code == FAILED
    assert "Traceback" not in said
    screen = pyte.Screen(COLUMNS, ROWS)
    pyte.Stream(screen).feed(said)
    *shown, told = [line.rstrip() for line in screen.display if line.strip()]
    assert told == "interrupted; files that were already written are kept"
    assert [bar[1] for bar in bars(shown)][-1] == "diagnosis"
    assert not screen.cursor.hidden
