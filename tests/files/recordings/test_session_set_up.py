"""Micrometer readings of balls put up under the spindle: from the session file to calculations, and what can be wrong."""

from __future__ import annotations

import shutil
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import SessionDetails
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.plan.plan import Direction
from dbbstation.station.opening import open_session

UNDER_SPINDLE = shipped_folder("fixtures") / "sessions" / "under-spindle"
ENTRY = "{test: g, mounting: 2, fixed_ball_um: [10.0, 35.0, -45.0], moving_ball_um: [-17.0, -34.0, null], uncertainty_um: 1.0}"


@pytest.fixture
def session(tmp_path: Path) -> Path:
    folder = tmp_path / "under-spindle"
    shutil.copytree(UNDER_SPINDLE, folder)
    return folder


def edit(folder: Path, old: str, new: str, name: str = "session.yaml", count: int = 1) -> int:
    path = folder / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))
    return text.count("\n", 0, text.index(old)) + 1


def faults_of(folder: Path) -> list[tuple[str, int, str]]:
    with pytest.raises(InputError) as caught:
        read_session(folder)
    return [(Path(p.file).name, p.line, f"{p.what}; {p.remedy}") for p in caught.value.problems]


def test_readings_reach_the_runs_of_their_mounting() -> None:
    session = read_session(UNDER_SPINDLE)
    for run in session.runs:
        setup = session.setup(run)
        assert not setup.place_known
        fixed, moving = {"d": ([39, 53, -15], [65, 145, np.nan]), "g": ([10, 35, -45], [-17, -34, np.nan])}[run.test]
        np.testing.assert_allclose(setup.set_up_errors.fixed_ball_mm, np.array(fixed) / 1e3)
        np.testing.assert_allclose(setup.set_up_errors.moving_ball_mm, np.array(moving) / 1e3)
        assert setup.set_up_errors.uncertainty_mm == 0.001
    assert session.setup(session.runs[0]).fixed_ball_mm.tolist() == [100.0, 100.0, -1150.0]


def test_a_ball_that_the_cmm_knows_has_a_known_place_and_no_readings() -> None:
    small = read_session(shipped_folder("fixtures") / "sessions" / "small")
    assert {small.setup(run).place_known for run in small.runs} == {True}
    assert {small.setup(run).set_up_errors for run in small.runs} == {None}


def test_what_is_not_read_may_be_left_out(session: Path) -> None:
    edit(session, "moving_ball_um: [65.0, 145.0, null], ", "")
    edit(session, f"  - {ENTRY}\n", "")
    read = read_session(session)
    first, last = (read.setup(run) for run in (read.runs[0], read.runs[-1]))
    assert np.isnan(first.set_up_errors.moving_ball_mm).all()
    assert last.set_up_errors is None
    assert not last.place_known


def test_runs_without_a_number_are_one_mounting_per_test(session: Path) -> None:
    edit(session, "mounting: 2, ", "", count=3)
    read = read_session(session)
    assert read.set_up_errors[1].mounting is None
    assert read.setup(read.runs[-1]).set_up_errors.fixed_ball_mm[0] == 0.010


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("test: g, mounting: 2, fixed", "test: g, mounting: 7, fixed", "set_up_errors[1]: no run of test g has the mounting 7; its mountings: 2"),
        ("test: g, mounting: 2, fixed", "test: g, mounting: 1, fixed", "set_up_errors[1]: no run of test g has the mounting 1; its mountings: 2"),
        ("test: g, mounting: 2, fixed", "test: g, fixed", "set_up_errors[1]: the runs of test g have mounting numbers, the entry has none; give `mounting`: 2"),
        ("test: g, mounting: 2, fixed", "test: z, mounting: 2, fixed", "set_up_errors[1]: the plan has no test `z`; its tests: d, g"),
        ("test: g, mounting: 2, fixed", "test: d, mounting: 1, fixed", "set_up_errors[1]: this is the mounting of set_up_errors[0] a second time; keep one of the two"),
        ("[10.0, 35.0, -45.0]", "[10.0, 35.0]", "set_up_errors[1].fixed_ball_um: "),
        ("[10.0, 35.0, -45.0]", "[10.0, ten, -45.0]", "set_up_errors[1].fixed_ball_um[1]: a number was expected, not the text `ten`"),
        ("[10.0, 35.0, -45.0]", "[10.0, 9350.0, -45.0]", "set_up_errors[1].fixed_ball_um[1]: 9350 µm is not plausible, expected -5000 to 5000 µm"),
        ("null], uncertainty_um: 1.0}\nruns", "null], uncertainty_um: 0.001}\nruns", "set_up_errors[1].uncertainty_um: 0.001 µm is not plausible, expected 0.01 to 1000 µm (it looks like mm)"),
        ("null], uncertainty_um: 1.0}\nruns", "null]}\nruns", "set_up_errors[1]: the key `uncertainty_um` is missing"),
    ],
)  # fmt: skip
def test_faults_with_their_lines(session: Path, old: str, new: str, said: str) -> None:
    line = edit(session, old, new)
    ((file, where, what),) = faults_of(session)
    assert (file, where) == ("session.yaml", line)
    assert what.startswith(said)


def test_readings_of_a_ball_that_the_cmm_measured_are_refused(session: Path) -> None:
    old = "g: {placed: under-spindle, centre_mm: [-100.0, 0.0, -1008.0]}}"
    new = "g: {holder: stand, centre_mm: [-100.0, 0.0, -1008.0], uncertainty_um: 0.8}}"
    edit(session, old, new, "plan.yaml")
    jig = "jig: {bores: {}, origin_in_machine_mm: [0, 0, 0]}"
    edit(session, "holders: {}", f"holders: {{stand: {{repeatability_um: 1.0}}}}\n{jig}", "plan.yaml")
    ((file, _, what),) = faults_of(session)
    assert file == "session.yaml"
    assert what.startswith(
        "set_up_errors[1]: the ball `g` of test g was measured by the CMM; set-up errors are read of"
    )


def test_readings_before_any_run_are_refused(session: Path) -> None:
    text = (session / "session.yaml").read_text()
    (session / "session.yaml").write_text(text.split("runs:")[0])
    assert [what for *_, what in faults_of(session)] == [
        f"set_up_errors[{k}]: test {test} has no run; check the test" for k, test in enumerate("dg")
    ]


def test_readings_written_in_while_a_run_is_recorded_are_kept(session: Path) -> None:
    edit(session, f"  - {ENTRY}\n", "")
    writer = SessionWriter.open(session)
    with writer.start_run("g", Direction.CW, ("t_s", "length_mm"), started=datetime.now(UTC), mounting=3) as journal:
        journal.append((0.0, 150.0))
        edit(session, "runs:\n", f"  - {ENTRY.replace('mounting: 2', 'mounting: 3')}\nruns:\n")
        writer.judge(writer.finish_run(journal), accepted=True)
    again = read_session(session)
    assert [(entry.test, entry.mounting) for entry in again.set_up_errors] == [("d", 1), ("g", 3)]
    assert again.set_up_errors == writer.session.set_up_errors
    assert again.setup(again.runs[-1]).set_up_errors.fixed_ball_mm.tolist() == [0.010, 0.035, -0.045]


def test_a_slip_in_readings_written_in_meanwhile_is_told_and_nothing_is_overwritten(session: Path) -> None:
    writer = SessionWriter.open(session)
    with writer.start_run("g", Direction.CW, ("t_s", "length_mm"), started=datetime.now(UTC), mounting=3) as journal:
        journal.append((0.0, 150.0))
        edit(session, "mounting: 2, fixed", "mounting: 9, fixed")
        written = (session / "session.yaml").read_text()
        with pytest.raises(InputError, match="no run of test g has the mounting 9"):
            writer.finish_run(journal)
    assert (session / "session.yaml").read_text() == written
    edit(session, "mounting: 9, fixed", "mounting: 2, fixed")
    writer.close()
    assert [run.state.value for run in SessionWriter.open(session).runs][-1] == "complete"


def test_going_on_with_a_session_keeps_the_readings_to_the_digit(session: Path) -> None:
    edit(session, "[10.0, 35.0, -45.0]", "[10.1, 35, -0.3]")
    before = read_session(session).set_up_errors
    plan = read_inline_plan(session / "plan.yaml")
    writer = open_session(session, read_session(session).machine, plan, SessionDetails(), with_programs=False)
    with writer.start_run("g", Direction.CW, ("t_s", "length_mm"), started=datetime.now(UTC), mounting=3) as journal:
        journal.append((0.0, 150.0))
        writer.judge(writer.finish_run(journal), accepted=True)
    again = read_session(session)
    assert (again.set_up_errors, len(again.runs)) == (before, 5)
    writer.close()
    assert (
        "fixed_ball_um: [10.1, 35.0, -0.3], moving_ball_um: [-17.0, -34.0, null]"
        in (session / "session.yaml").read_text()
    )
    # The ball was put up anew for the last run: nobody has measured that.
    assert again.setup(again.runs[-1]).set_up_errors is None
    SessionWriter.open(session)
    assert read_session(session).set_up_errors == before
