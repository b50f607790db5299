"""`dbbstation measure` in a process of its own, over a pseudo-terminal."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan, read_plan
from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.run_csv import read_run
from dbbstation.files.recordings.session import read_session
from dbbstation.service.choice import Gate, Order, ordered
from dbbstation.station.assembly import check_plan
from dbbstation.trace.cut import cut
from dbbstation.virtual.machine import Sizes
from tests.cli.conftest import call
from tests.copied import started
from tests.station.bench import MACHINE_FILE, POLLED, STREAM, bench, lines_of, wait_for

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.virtual.machine import VirtualMachine
    from tests.station.bench import Bench

pytestmark = pytest.mark.usefixtures("copies")

QUIET = Sizes(noise_mm=0.0003, bar_uncertainty_mm=0.0005)


def apart(session: SessionFolder, run: RunEntry, machine: VirtualMachine) -> tuple[float, float]:
    """How far a recording is late against the truth [deg], and what that leaves of their difference [µm rms]."""
    circle = session.circle(run)
    raw = cut(session.load(run).recording, circle)
    machine.mounted, machine.mountings = session.plan.tests[run.test].ball, run.mounting or 0
    true = machine.run(run.test, run.direction)
    t_s = true.path.duration_s / 2.0 + (raw.phi_deg - 180.0) / circle.turning_deg_s
    length = np.interp(t_s, true.path.t_s, true.length_mm)
    slope = np.gradient(length, raw.phi_deg)
    late_deg = float(slope @ (raw.length_mm - length) / (slope @ slope))
    left_mm = raw.length_mm - length - slope * late_deg
    return late_deg, 1e3 * float(np.sqrt(np.mean(left_mm**2)))


def test_a_whole_short_plan_agrees_with_the_truth(plan_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    with bench(plan_file, sizes=QUIET) as place:
        done = place.measure(out, "--operator", "me", "--bar-length-mm", "150", "--bar-uncertainty-um", "0.5", "--json")
        assert done.returncode == 0, done.stderr
        summary = json.loads(done.stdout)
        session = read_session(out)
        for run in session.runs:
            late_deg, left_um = apart(session, run, place.cell.machine)
            # At this scale a tenth of a degree is a quarter of a millisecond of the computer's attention.
            assert abs(late_deg) < 0.1, run.label
            assert left_um < 0.4, run.label
        finished_and_another_plan(place, out)
    assert (summary["state"], summary["accepted"], summary["planned"], summary["missing"]) == ("finished", 6, 6, [])
    assert {run["lost"] for run in summary["runs"]} == {0}
    assert [run.mounting for run in session.runs] == [1, 1, 2, 2, 3, 3]
    assert {run.state for run in session.runs} == {RunState.ACCEPTED}
    assert (session.operator, session.bar is not None) == ("me", True)
    assert "1 of 6: test a ccw" in done.stderr
    assert "into bore 9" in done.stderr
    assert "\r" not in done.stderr


def finished_and_another_plan(place: Bench, out: Path) -> None:
    before = (out / "session.yaml").read_bytes()
    again = call(*place.command(out))
    assert (again.code, (out / "session.yaml").read_bytes()) == (0, before)
    text = place.plan_file.read_text(encoding="utf-8")
    place.plan_file.write_text(text.replace("[ccw, cw]", "[ccw]"), encoding="utf-8")
    other = call(*place.command(out))
    assert other.code == 1
    assert "the plan of this session is another one" in other.err
    assert "Traceback" not in other.err


def test_a_polled_display_is_measured_too(plan_file: Path, tmp_path: Path) -> None:
    text = plan_file.read_text(encoding="utf-8")
    plan_file.write_text(text.replace("[ccw, cw]", "[cw]").replace("repeat_at_end: [a]\n", ""), encoding="utf-8")
    out = tmp_path / "session"
    planned = ordered(read_inline_plan(plan_file), Order.DRIFT, Gate.FIRST).to_domain()
    with bench(plan_file, instrument=POLLED, scale=20.0, rate_hz=None) as place:
        done = place.measure(out, "--order", "drift", "--gate", "first")
    assert done.returncode == 0, done.stderr
    runs = read_session(out).runs
    accepted = [run.test for run in runs if run.state is RunState.ACCEPTED]
    assert accepted == [*planned.tests, *planned.repeat_at_end]
    *_, last = runs
    assert last.state is RunState.ACCEPTED
    # Nobody knows when between request and reply it took its length.
    assert (read_run(last.path).recording.logged["t_uncertainty_s"] > 0.0).all()


def test_a_person_answers_with_keys(plan_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    with bench(plan_file) as place:
        done = place.measure(out, auto=False, typed="s\nwhat\nx\nq\n")
    assert done.returncode == 0, done.stderr
    assert "Enter: ready" in done.stderr
    assert "2 of 6: test a cw" in done.stderr
    assert "`what` is no answer" in done.stderr
    assert "means nothing while waiting for the set-up" in done.stderr
    assert "0 of 6 runs accepted" in done.stdout


@pytest.mark.slow
def test_ctrl_c_keeps_everything_and_the_same_command_goes_on(plan_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "session"
    text = plan_file.read_text(encoding="utf-8").replace("repeat_at_end: [a]\n", "").replace(": 1000", ": 2000")
    plan_file.write_text(re.sub(r"  - \{name: b.*\n", "", text), encoding="utf-8")
    # Slow enough that a busy computer leaves no hole in a circle.
    with bench(plan_file, scale=10.0, rate_hz=20.0) as place:
        part = out / "runs" / "a-cw-1.csv.part"
        with started(place.command(out), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
            wait_for(lambda: lines_of(part) > 100, process)
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=30.0)
        assert process.returncode == 1
        assert "a-cw-1: interrupted, kept as far as it came" in said
        assert "Traceback" not in said
        kept = part.read_bytes()
        done = place.measure(out)
        assert done.returncode == 0, done.stderr
    session = read_session(out)
    assert [(run.label, run.state.value) for run in session.runs] == [
        ("a ccw 1", "accepted"),
        ("a cw 1", "recording"),
        ("a cw 2", "accepted"),
    ]
    assert part.read_bytes() == kept
    # Nobody touched the holder meanwhile.
    assert [run.mounting for run in session.runs] == [1, 1, 1]
    starts = [run.started for run in session.runs if run.started is not None]
    assert starts == sorted(starts)


def test_a_circle_outside_the_travel_stops_before_anything_starts(plan_file: Path, tmp_path: Path) -> None:
    text = plan_file.read_text(encoding="utf-8").replace("radius_mm: 150.0", "radius_mm: 290.0")
    plan_file.write_text(text, encoding="utf-8")
    out = tmp_path / "session"
    words = ["--plan", str(plan_file), "--machine", str(MACHINE_FILE), "--instrument", STREAM]
    done = call("measure", *words, "--port", "/dev/nothing-here", "--out", str(out))
    assert done.code == 1
    assert "test b ccw" in done.err
    assert "its travel 0 to 300 mm" in done.err
    assert not out.exists()


@pytest.mark.parametrize("url", ["tcp://192.168.1.7:4000", "tcp://127.0.0.1", "nonsense"])
def test_only_machines_on_this_computer_are_started(url: str, plan_file: Path, tmp_path: Path) -> None:
    words = ["--plan", str(plan_file), "--machine", str(MACHINE_FILE), "--instrument", STREAM]
    words += ["--port", "/dev/nothing-here", "--out", str(tmp_path / "session"), "--auto", url]
    done = call("measure", *words)
    assert done.code == 1
    assert "no control address of a virtual machine on this computer" in done.err


def test_the_shipped_plans_can_be_measured() -> None:
    for path in sorted((shipped_folder("protocols") / "plans").glob("*.yaml")):
        check_plan(read_plan(path), read_machine(MACHINE_FILE), file=str(path))


@pytest.mark.slow
def test_balls_under_the_spindle_from_the_plan_to_the_figures(tmp_path: Path) -> None:
    text = (shipped_folder("protocols") / "plans" / "conventional.yaml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("  - {name: ") or line[11] in "dg"]
    plan_file, out = tmp_path / "conventional.yaml", tmp_path / "session"
    plan_file.write_text("\n".join(lines), encoding="utf-8")
    with bench(plan_file, sizes=QUIET) as place:
        done = place.measure(out, "--json")
        assert done.returncode == 0, done.stderr
        truth = place.cell.machine.describe()["set_up_errors"]
        session = read_session(out)
        for run in session.runs:
            assert apart(session, run, place.cell.machine)[1] < 0.4, run.label
        assert [(stands["ball"], stands["mounting"]) for stands in truth] == [("d", 1), ("g", 2)]
        pose = "X 100.000 Y 100.000 Z -1150.000 A -10° B 10°"
        assert f"Drive the machine to {pose} and put the ball d up under the spindle" in done.stderr
        assert "Leave the ball d and the moving ball as they stand" in done.stderr
        assert "samples; set-up off" in done.stderr
        assert "bore" not in done.stderr
    assert [run.mounting for run in session.runs] == [1, 1, 2, 2]
    readings = "".join(
        f"  - {{test: {stands['ball']}, mounting: {stands['mounting']}, uncertainty_um: 1.0,"
        f" fixed_ball_um: {stands['fixed_ball_um']}, moving_ball_um: {stands['moving_ball_um']}}}\n"
        for stands in truth
    )
    noted = (out / "session.yaml").read_text(encoding="utf-8").replace("runs:\n", f"set_up_errors:\n{readings}runs:\n")
    (out / "session.yaml").write_text(noted, encoding="utf-8")
    checked = call("check", out)
    assert checked.code == 0, checked.err
    for run in read_session(out).runs:
        setup = read_session(out).setup(run)
        assert setup.set_up_errors is not None
        told = truth[(run.mounting or 0) - 1]
        np.testing.assert_allclose(setup.set_up_errors.fixed_ball_mm * 1e3, told["fixed_ball_um"], atol=1e-9)


def test_a_session_goes_on_with_its_micrometer_readings(tmp_path: Path) -> None:
    out, source = tmp_path / "session", shipped_folder("fixtures") / "sessions" / "under-spindle"
    shutil.copytree(source, out)
    text = (out / "session.yaml").read_text(encoding="utf-8")
    # It says that it is of a virtual machine; as an older program wrote it, it takes no virtual circles.
    virtual = "format: dbb-session/1\ninstrument: {name: streaming-encoder, virtual: true}"
    text = re.sub("format: dbb-session/.", virtual, text)
    kept = [line for line in text.splitlines() if not line.startswith("  - {test: g, direction: cw")]
    (out / "runs" / "g-cw-1.csv").unlink()
    (out / "session.yaml").write_text("\n".join(kept) + "\n", encoding="utf-8")
    before = read_session(out)
    with bench(out / "plan.yaml") as place:
        done = place.measure(out)
    assert done.returncode == 0, done.stderr
    after = read_session(out)
    assert (len(before.runs), len(after.runs)) == (3, 4)
    assert after.set_up_errors == before.set_up_errors
