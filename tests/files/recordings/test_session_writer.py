"""A session folder while runs come in, and after the station died at any moment."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import InputError, OutputError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import RunState, SessionDetails
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.new_session import FinishedRun, write_session
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.plan.bar import Bar
from dbbstation.plan.plan import Direction

BEGUN = datetime(2026, 11, 20, 8, 0, 0, 250000, tzinfo=UTC)
COLUMNS = ("t_s", "length_mm")
PLAN = read_inline_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
DETAILS = SessionDetails(
    serial_number="PM600-0007",
    operator="first: shift",
    ambient_temp_c=20.4,
    bar=Bar("", 150.0003, 0.0005, BEGUN, None, None),
)


@pytest.fixture
def machine():
    return read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml")


@pytest.fixture
def writer(tmp_path: Path, machine) -> SessionWriter:
    return SessionWriter.create(tmp_path / "new", machine, PLAN, DETAILS)


def fill(journal, count: int = 700) -> None:
    for index in range(count):
        journal.append((index / 10, 150.0))


def reread(writer: SessionWriter) -> list[tuple[str, str, str]]:
    session = read_session(writer.session.folder)
    assert session.sha256 == writer.session.sha256
    assert session.runs == writer.runs
    return [(run.label, run.state.value, run.path.name) for run in session.runs]


def test_a_new_session_holds_machine_and_plan(writer: SessionWriter, machine) -> None:
    session = read_session(writer.session.folder)
    assert sorted(path.name for path in session.folder.iterdir()) == [
        ".lock", "events.log", "machine.yaml", "plan.yaml", "programs", "runs", "sealed", "session.yaml"
    ]  # fmt: skip
    assert session.plan == PLAN.to_domain()
    assert np.array_equal(session.machine.hexapod.base_joints_mm, machine.hexapod.base_joints_mm)
    assert (session.serial_number, session.operator, session.ambient_temp_c, session.bar) == (
        DETAILS.serial_number, DETAILS.operator, DETAILS.ambient_temp_c, DETAILS.bar
    )  # fmt: skip
    assert session.runs == ()


def test_an_existing_folder_is_refused(writer: SessionWriter, machine) -> None:
    with pytest.raises(OutputError, match="the session folder exists already; choose another name"):
        SessionWriter.create(writer.session.folder, machine, PLAN)


def test_a_run_from_start_to_verdict(writer: SessionWriter) -> None:
    with writer.start_run("low", Direction.CCW, COLUMNS, started=BEGUN, mounting=1) as journal:
        assert reread(writer) == [("low ccw 1", "recording", "low-ccw-1.csv.part")]
        fill(journal)
        run = writer.finish_run(journal)
    assert reread(writer) == [("low ccw 1", "complete", "low-ccw-1.csv")]
    run = writer.judge(run, accepted=False, reason="bumped: at {90} deg, twice")
    assert reread(writer) == [("low ccw 1", "rejected", "low-ccw-1.csv")]
    assert read_session(writer.session.folder).runs[0].reason == "bumped: at {90} deg, twice"
    run = writer.judge(run, accepted=True)
    assert (run.state, run.reason, run.started) == (RunState.ACCEPTED, "", BEGUN)
    assert len(read_session(writer.session.folder).load(run).recording) == 700


def test_a_repeated_run_gets_the_next_number(writer: SessionWriter) -> None:
    for _ in range(2):
        with writer.start_run("low", Direction.CW, COLUMNS, started=BEGUN) as journal:
            fill(journal)
            writer.judge(writer.finish_run(journal), accepted=False, reason="operator")
    with writer.start_run("low", Direction.CCW, COLUMNS, started=BEGUN) as journal:
        fill(journal)
    assert [entry[0] for entry in reread(writer)] == ["low cw 1", "low cw 2", "low ccw 1"]
    assert writer.next_repeat("low", Direction.CCW) == 2
    (writer.session.folder / "runs" / "high-cw-1.csv.part").write_text("")
    assert writer.next_repeat("high", Direction.CW) == 2


def test_what_the_plan_does_not_have(writer: SessionWriter) -> None:
    with pytest.raises(InputError, match="the plan has no run nowhere cw"):
        writer.start_run("nowhere", Direction.CW, COLUMNS, started=BEGUN)
    assert list((writer.session.folder / "runs").iterdir()) == []


def test_programs_and_centres_are_kept(writer: SessionWriter) -> None:
    program = writer.add_program("low-cw.ngc", b"G1\n", model_sha256="ab" * 32)
    assert writer.add_program("low-cw.ngc", b"G1\n", model_sha256="ab" * 32) == program
    with pytest.raises(OutputError, match="exists already"):
        writer.add_program("low-cw.ngc", b"G2\n")
    centre_mm = (0.001, -0.002, -1150.0)
    with writer.start_run("low", Direction.CW, COLUMNS, started=BEGUN, program=program, centre_mm=centre_mm) as journal:
        fill(journal)
        writer.finish_run(journal)
    run = read_session(writer.session.folder).runs[0]
    assert (run.program, run.centre_mm) == (program, centre_mm)


def test_the_station_died_while_recording(writer: SessionWriter) -> None:
    journal = writer.start_run("low", Direction.CW, COLUMNS, started=BEGUN, mounting=1)
    fill(journal)
    journal.close()
    writer.close()
    again = SessionWriter.open(writer.session.folder)
    assert reread(again) == [("low cw 1", "recording", "low-cw-1.csv.part")]
    assert len(again.session.load(again.runs[0]).recording) == 700
    with again.start_run("low", Direction.CW, COLUMNS, started=BEGUN + timedelta(minutes=3), mounting=1) as journal:
        fill(journal)
        again.finish_run(journal)
    assert [entry[:2] for entry in reread(again)] == [("low cw 1", "recording"), ("low cw 2", "complete")]
    with pytest.raises(OutputError, match="cannot be judged"):
        again.judge(again.runs[0], accepted=True)


def test_the_station_died_before_the_part_was_noted(writer: SessionWriter) -> None:
    folder = writer.session.folder
    before = {name: (folder / name).read_bytes() for name in ("session.yaml", "events.log")}
    journal = writer.start_run("low", Direction.CW, COLUMNS, started=BEGUN)
    fill(journal)
    journal.close()
    for name, data in before.items():
        (folder / name).write_bytes(data)
    writer.close()
    again = SessionWriter.open(folder)
    assert reread(again) == [("low cw 1", "recording", "low-cw-1.csv.part")]
    assert b"low-cw-1.csv.part" in (folder / "session.yaml").read_bytes()


def test_the_station_died_between_sealing_and_noting_it(writer: SessionWriter) -> None:
    folder = writer.session.folder
    journal = writer.start_run("low", Direction.CW, COLUMNS, started=BEGUN)
    fill(journal)
    noted = {name: (folder / name).read_bytes() for name in ("session.yaml", "events.log")}
    done = writer.finish_run(journal)
    for name, data in noted.items():
        (folder / name).write_bytes(data)
    assert read_session(folder).runs[0].state is RunState.RECORDING
    writer.close()
    again = SessionWriter.open(folder)
    assert again.runs[0] == done
    assert reread(again) == [("low cw 1", "complete", "low-cw-1.csv")]


def test_a_whole_session_at_once(tmp_path: Path, machine) -> None:
    t_s = np.arange(700) / 10
    columns = {"t_s": t_s, "length_mm": 150.0 + 0.01 * np.sin(t_s), "theta_deg": t_s * 5}
    runs = [
        FinishedRun("low", Direction.CCW, columns),
        FinishedRun("low", Direction.CW, columns, mounting=1, started=BEGUN, program=("low-cw.ngc", b"G1\n")),
    ]
    write_session(tmp_path / "whole", machine, PLAN, runs)
    session = read_session(tmp_path / "whole")
    assert [run.state for run in session.runs] == [RunState.ACCEPTED] * 2
    assert session.runs[1].program.path.read_bytes() == b"G1\n"
    loaded = session.load(session.runs[0]).recording
    assert loaded.length_mm == pytest.approx(columns["length_mm"], abs=5.1e-7)
    assert loaded.theta_deg == pytest.approx(columns["theta_deg"], abs=5.1e-7)
    with pytest.raises(OutputError, match="exists already"):
        write_session(tmp_path / "whole", machine, PLAN, runs)


def test_a_whole_session_or_nothing(tmp_path: Path, machine) -> None:
    columns = {"t_s": np.arange(3.0), "length_mm": np.array([150.0, np.nan, 150.0])}
    with pytest.raises(ValueError, match="length_mm is nan"):
        write_session(tmp_path / "whole", machine, PLAN, [FinishedRun("low", Direction.CCW, columns)])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "details",
    [
        SessionDetails(bar=Bar("", 0.15, 0.0005, None, None, None)),
        SessionDetails(ambient_temp_c=float("nan")),
        SessionDetails(bar=Bar("", 100.0, 0.0005, None, None, None)),
    ],
    ids=["metres", "no number", "another bar"],
)
def test_details_that_no_session_may_have_make_no_folder(tmp_path: Path, machine, details) -> None:
    with pytest.raises(InputError):
        SessionWriter.create(tmp_path / "new", machine, PLAN, details)
    assert not list(tmp_path.iterdir())
    SessionWriter.create(tmp_path / "new", machine, PLAN, DETAILS).close()


def test_a_seal_that_fails_tells_why_and_nothing_else_fails_after_it(writer: SessionWriter, monkeypatch) -> None:
    journal = writer.start_run("low", Direction.CW, COLUMNS, started=BEGUN)
    fill(journal)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(OutputError, match="no space left on device"):
        writer.finish_run(journal)
    journal.sync()
    journal.close()
    assert journal.path.is_file()
