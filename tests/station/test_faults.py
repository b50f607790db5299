"""What can happen to a line and a program while a circle is recorded; nothing recorded may be lost."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

from dbbstation.files.formats.session import RunState
from dbbstation.files.recordings.run_csv import read_run
from dbbstation.files.recordings.session import read_session
from tests.cli.conftest import call
from tests.copied import started
from tests.station.bench import POLLED, bench, lines_of, wait_for

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.station.bench import Bench

pytestmark = pytest.mark.usefixtures("copies")


@pytest.fixture
def one_circle(plan_file: Path) -> Path:
    text = plan_file.read_text(encoding="utf-8").replace("[ccw, cw]", "[ccw]").replace("repeat_at_end: [a]\n", "")
    plan_file.write_text(re.sub(r"  - \{name: b.*\n", "", text), encoding="utf-8")
    return plan_file


def spoilt(place: Bench, out: Path, spoil: Callable[[], None], *, at_lines: int = 300) -> tuple[int, str]:
    """Measure, do something in mid-run, wait for the end; return the exit code and what was said."""
    part = out / "runs" / "a-ccw-1.csv.part"
    with started(place.command(out), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        wait_for(lambda: lines_of(part) > at_lines, process)
        spoil()
        _, said = process.communicate(timeout=60.0)
    return process.returncode, said


def test_killed_in_mid_run_it_loses_nothing_and_goes_on(one_circle: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    part = out / "runs" / "a-ccw-1.csv.part"
    with bench(one_circle, scale=30.0) as place:
        with started(place.command(out), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
            wait_for(lambda: lines_of(part) > 300)
            process.kill()
        kept = part.read_bytes()
        half = read_run(part)
        assert len(half.recording) == lines_of(part) >= 300
        assert half.warnings == ()
        done = place.measure(out)
        assert done.returncode == 0, done.stderr
    session = read_session(out)
    assert [(run.label, run.state, run.mounting) for run in session.runs] == [
        ("a ccw 1", RunState.RECORDING, 1),
        ("a ccw 2", RunState.ACCEPTED, 1),
    ]
    assert part.read_bytes() == kept


def test_a_line_closed_in_mid_run(one_circle: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    with bench(one_circle, scale=30.0) as place:
        code, said = spoilt(place, out, place.wire.hang_up)
    assert code == 1
    assert "the line was closed while it was in use" in said
    assert "a-ccw-1: interrupted, kept as far as it came" in said
    assert "Traceback" not in said
    session = read_session(out)
    assert [run.state for run in session.runs] == [RunState.RECORDING]
    assert len(session.load(session.runs[0]).recording) > 300
    # Plugged in again, the same command goes on.
    with bench(one_circle) as place:
        done = place.measure(out)
    assert done.returncode == 0, done.stderr
    session = read_session(out)
    assert [run.state.value for run in session.runs] == ["recording", "accepted"]
    # Another machine stands there now: its ball was put up anew, although the plan did not ask for it.
    assert session.runs[1].mounting == 2


def test_an_instrument_that_falls_silent_in_mid_run(one_circle: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    with bench(one_circle, scale=30.0) as place:
        code, said = spoilt(place, out, place.wire.go_silent)
    assert code == 1
    assert "fell silent" in said
    assert "Traceback" not in said
    session = read_session(out)
    assert len(session.load(session.runs[0]).recording) > 300


def test_garbage_and_half_lines_cost_single_samples(one_circle: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"

    def spoil() -> None:
        place.wire.send_garbage(b"\xff\x00#!?,")
        place.wire.cut_next_frame(9)
        place.wire.drop_samples(3)

    with bench(one_circle, scale=30.0) as place:
        code, said = spoilt(place, out, spoil)
    assert code == 0, said
    session = read_session(out)
    assert [run.state for run in session.runs] == [RunState.ACCEPTED]
    assert "samples lost" in said
    lengths = session.load(session.runs[0]).recording.length_mm
    assert lengths.min() > 148.0
    assert lengths.max() < 152.0


def test_a_run_that_lost_more_than_the_plan_allows_is_measured_again(one_circle: Path, tmp_path: Path) -> None:
    """60 of some 2300 samples of the turn, from its middle: the circle is there, and nobody would see it."""
    out = tmp_path / "session"
    with bench(one_circle, scale=30.0) as place:
        code, said = spoilt(place, out, lambda: place.wire.drop_samples(60))
        assert code == 0, said
    assert re.search(r"a-ccw-1: 60 of \d{4} samples were lost \(2\.\d %\), more than the 0\.5 %", said), said
    session = read_session(out)
    assert [(run.label, run.state) for run in session.runs] == [
        ("a ccw 1", RunState.REJECTED),
        ("a ccw 2", RunState.ACCEPTED),
    ]
    assert "60 of" in session.runs[0].reason


def test_a_plan_may_allow_more(one_circle: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    text = one_circle.read_text(encoding="utf-8").replace("dbb-plan/1", "dbb-plan/1")
    one_circle.write_text(text + "largest_loss_percent: 5\n", encoding="utf-8")
    with bench(one_circle, scale=30.0) as place:
        code, said = spoilt(place, out, lambda: place.wire.drop_samples(60))
    assert code == 0, said
    assert ", 60 samples lost" in said
    assert [run.state for run in read_session(out).runs] == [RunState.ACCEPTED]


def test_a_wrong_baud_rate(one_circle: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    with bench(one_circle, instrument=POLLED, scale=1.0, rate_hz=None) as place:
        done = place.measure(out, "--baud", "2400")
    assert done.returncode == 1
    assert "baud" in done.stderr
    assert "Traceback" not in done.stderr
    assert read_session(out).runs == ()


def test_a_port_that_is_not_there_leaves_no_session(one_circle: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    with bench(one_circle) as place:
        command = place.command(out)
        command[command.index("--port") + 1] = "/dev/nothing-here"
        done = call(*command)
    assert done.code == 1
    assert "there is no such port" in done.err
    assert not out.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="processes that are stopped and continued")
@pytest.mark.parametrize("seconds", [1.0, pytest.param(10.0, marks=pytest.mark.nightly)])
def test_a_host_that_falls_asleep_in_mid_run(one_circle: Path, tmp_path: Path, seconds: float) -> None:
    out = tmp_path / "session"
    part = out / "runs" / "a-ccw-1.csv.part"
    with (
        bench(one_circle, scale=10.0) as place,
        started(place.command(out), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process,
    ):
        wait_for(lambda: lines_of(part) > 300, process)
        process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        process.send_signal(signal.SIGCONT)
        _, said = process.communicate(timeout=120.0)
    assert "Traceback" not in said
    assert "fault of dbbstation" not in said
    assert process.returncode == 0, said
    session = read_session(out)
    assert [run.state for run in session.runs].count(RunState.ACCEPTED) == 1
    for run in session.runs:
        recording = session.load(run).recording
        assert run.counts is not None
        assert run.counts.received == len(recording)
        if run.state is RunState.REJECTED:
            assert run.counts.lost > 0
            assert "lost" in run.reason
