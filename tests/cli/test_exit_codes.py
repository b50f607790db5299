"""Exit codes, refusals to overwrite, tracebacks on request only, interruptions."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys

import pytest

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.files.places import shipped_folder
from tests import copied

PROGRAM = [sys.executable, "-m", "dbbstation"]
PATIENCE_S = 60

pytestmark = pytest.mark.usefixtures("copies")


@pytest.mark.parametrize(
    "arguments",
    [
        ["calibrat"],
        ["calibrate"],
        ["calibrate", "session", "--colour"],
        ["evaluate", "session"],
        ["simulate", "--model", "m", "p", "--out", "o", "--samples", "3"],
        ["check"],
        ["check", "--schema", "dbb-plan/9"],
        ["compensate", "part.ngc", "--model", "m", "--out", "o", "--start", "1,2,3"],
    ],
    ids=" ".join,
)
def test_a_command_line_that_is_not_understood(run, arguments):
    outcome = run(*arguments)
    assert (outcome.code, outcome.out) == (USAGE, "")
    assert outcome.err.startswith("Usage: dbbstation")
    assert "Error: " in outcome.err


def test_the_nearest_command_and_flag_are_named(run):
    assert "did you mean calibrate?" in run("calibrat").err
    assert "--tests" in run("circles", "x", "--test", "a").err


@pytest.fixture
def written(tmp_path, model, elsewhere):
    plan, machine = elsewhere / "plan.yaml", elsewhere / "machine.yaml"
    (tmp_path / "in.csv").write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n")
    (tmp_path / "part.ngc").write_text("G21 G90 G94\nG1 X0 Y0 Z-1000 A0 B0 C0 F1000\nX50\nM2\n")
    out = tmp_path / "out"
    return {
        "calibrate": (["calibrate", elsewhere, "--out", out], out),
        "predict": (["predict", "--model", model, tmp_path / "in.csv", "--table", out], out),
        "program": (["program", "--plan", plan, "--machine", machine, "--tests", "d", "--out", out], out / "d-cw.ngc"),
        "compensate": (["compensate", tmp_path / "part.ngc", "--model", model, "--out", out], out),
    }


@pytest.mark.parametrize("command", ["calibrate", "predict", "program", "compensate"])
def test_nothing_is_overwritten_without_force(run, written, command):
    arguments, file = written[command]
    file.parent.mkdir(exist_ok=True)
    file.write_text("precious")
    refused = run(*arguments)
    assert (refused.code, refused.out) == (FAILED, "")
    assert refused.err == f"{file}: the file exists already; give --force to replace it\n"
    assert file.read_text() == "precious"
    assert [path.name for path in file.parent.iterdir() if ".new" in path.name] == []
    forced = run(*arguments, "--force")
    assert forced.code == DONE, forced.err
    assert file.read_text() != "precious"


def test_a_session_is_never_overwritten(run, tmp_path, model, elsewhere):
    (tmp_path / "out").mkdir()
    outcome = run("simulate", "--model", model, elsewhere / "plan.yaml", "--out", tmp_path / "out")
    assert outcome.code == FAILED
    assert "the session folder exists already" in outcome.err
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written(run, tmp_path, model):
    (tmp_path / "locked").mkdir(mode=0o500)
    (tmp_path / "in.csv").write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n")
    out = tmp_path / "locked" / "out.csv"
    outcome = run("predict", "--model", model, tmp_path / "in.csv", "--table", out)
    assert outcome.code == FAILED
    assert "permission denied" in outcome.err


def started(*arguments, **options):
    return copied.done(arguments, timeout=PATIENCE_S, **options)


@pytest.mark.parametrize("arguments", [["--debug", "calibrate", "nowhere"], ["calibrate", "nowhere", "--debug"]])
def test_debug_shows_the_traceback(tmp_path, arguments):
    outcome = started(*arguments, cwd=tmp_path)
    assert outcome.returncode == FAILED
    assert "Traceback (most recent call last)" in outcome.stderr
    assert "nowhere: there is no such file" in outcome.stderr


def test_without_debug_there_is_none(tmp_path):
    outcome = started("calibrate", "nowhere", cwd=tmp_path)
    assert (outcome.returncode, outcome.stdout) == (FAILED, "")
    assert outcome.stderr == "nowhere: there is no such file; check the path\n"


def test_a_fault_of_the_program_says_so(run, monkeypatch, fifteen):
    def broken(*_):
        raise ValueError("three is not two")

    monkeypatch.setattr("dbbstation.tasks.load.load_sessions", broken)
    outcome = run("calibrate", fifteen)
    assert outcome.code == FAILED
    assert outcome.err == (
        "ValueError: three is not two\nthis is a fault of dbbstation itself; --debug shows what to report\n"
    )
    with pytest.raises(ValueError, match="three is not two"):
        run("calibrate", fifteen, "--debug")


def test_a_reader_that_has_seen_enough(tmp_path):
    """As `dbbstation … | head -1` does; standard error stays empty."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as output:
        command = [*PROGRAM, "check", "--schema", "dbb-plan/1"]
        done = subprocess.run(
            command, stdout=output, stderr=subprocess.PIPE, text=True, check=False, cwd=tmp_path, timeout=PATIENCE_S
        )
    assert (done.returncode, done.stderr) == (FAILED, "")


def test_an_interrupt_leaves_no_half_result(run, monkeypatch, tmp_path, fifteen):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("dbbstation.calibration.fit.calibrate.linearise", interrupted)
    outcome = run("calibrate", fifteen, "--out", tmp_path / "model.yaml")
    assert (outcome.code, outcome.out) == (FAILED, "")
    assert outcome.err.strip() == "interrupted; files that were already written are kept"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_ctrl_c_a_polite_kill_and_a_closed_terminal(tmp_path, fifteen, name):
    words = ["calibrate", fifteen, "--out", tmp_path / "model.yaml", "--verbose"]
    with copied.started(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while "session.yaml" not in (line := process.stderr.readline()):
            assert line, "the program ended before it read the session"
        process.send_signal(getattr(signal, name))
        out, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out) == (FAILED, "")
    assert "interrupted; files that were already written are kept" in err
    assert "Traceback" not in err
    assert not (tmp_path / "model.yaml").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="signals and shells of Unix")
def test_what_nohup_made_it_deaf_to_stays_so():
    script = f"trap '' HUP; {shlex.quote(sys.executable)} -c {shlex.quote(HANGS_UP)}"
    done = subprocess.run(["/bin/sh", "-c", script], capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert (done.returncode, done.stderr) == (DONE, "")


HANGS_UP = """
import os, signal
from dbbstation.system.signals import politely_ended
with politely_ended():
    os.kill(os.getpid(), signal.SIGHUP)
"""


SMALL = shipped_folder("fixtures") / "sessions" / "small"


@pytest.mark.skipif(sys.platform == "win32", reason="signals and shells of Unix")
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize(("words", "code"), [("session list", DONE), ("session list nowhere", FAILED)])
def test_started_without_a_stream(tmp_path, closed, words, code):
    command = shlex.join([*PROGRAM, *words.split(), *([str(SMALL)] if code == DONE else [])])
    done = subprocess.run(
        ["/bin/sh", "-c", f"{command} {closed}"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        timeout=PATIENCE_S,
        env={**os.environ, "DBBSTATION_LOG": "off"},
    )
    assert (done.returncode, bool(done.stdout)) == (code, code == DONE and ">&-" not in closed.split())
    assert "fault of dbbstation" not in done.stderr


def test_no_file_takes_the_place_of_a_stream():
    """What a library complains of on standard error must not go into a recording."""
    script = "from dbbstation.cli.log import open_missing as o; o(); print(open('/dev/null').fileno())"
    done = subprocess.run(
        ["/bin/sh", "-c", f"exec {shlex.quote(sys.executable)} -c {shlex.quote(script)} <&- 2>&-"],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert int(done.stdout) > 2


def test_as_a_module_and_as_a_script():
    module = started("--version")
    assert (module.returncode, module.stderr) == (DONE, "")
    assert module.stdout.startswith("dbbstation, version ")


def test_json_goes_to_standard_output_alone(tmp_path):
    small = shipped_folder("fixtures") / "sessions" / "small"
    outcome = started("calibrate", small, "--out", tmp_path / "model.yaml", "--json")
    assert outcome.returncode == DONE
    assert outcome.stdout.startswith("{")
    assert outcome.stdout.endswith("}\n")
    assert "left out" in outcome.stderr
