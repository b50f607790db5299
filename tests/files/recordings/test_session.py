"""Reading sessions: the real ones, and everything that can be wrong with one."""

from __future__ import annotations

import hashlib
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.plan.plan import Direction

SMALL = shipped_folder("fixtures") / "sessions" / "small"


@pytest.fixture
def session(tmp_path: Path) -> Path:
    folder = tmp_path / "small"
    shutil.copytree(SMALL, folder)
    return folder


def edit(folder: Path, old: str, new: str, name: str = "session.yaml") -> tuple[int, int]:
    path = folder / name
    text = path.read_text()
    at = text.index(old)
    path.write_text(text.replace(old, new, 1))
    return text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)


def rewrite_run(folder: Path, name: str, change) -> None:
    path = folder / "runs" / name
    old = path.read_bytes()
    new = change(old.decode()).encode()
    path.write_bytes(new)
    edit(folder, hashlib.sha256(old).hexdigest(), hashlib.sha256(new).hexdigest())


def faults_of(folder: Path) -> list[tuple[str, int, int, str]]:
    with pytest.raises(InputError) as caught:
        read_session(folder)
    return [(Path(p.file).name, p.line, p.column, p.what) for p in caught.value.problems]


def load_faults(folder: Path, label: str) -> list[str]:
    session = read_session(folder)
    run = next(run for run in session.runs if run.label == label)
    with pytest.raises(InputError) as caught:
        session.load(run)
    return [problem.what for problem in caught.value.problems]


def test_a_session_by_its_folder_or_its_file() -> None:
    for path in (SMALL, SMALL / "session.yaml"):
        session = read_session(path)
        assert session.name == "small"
        assert (session.serial_number, session.operator, session.ambient_temp_c) == ("PM600-0007", "first shift", 20.4)
        assert (session.bar.serial_number, session.bar.calibrated_length_mm) == ("DBB-0042", 150.0003)
        assert session.bar.calibrated.isoformat() == "2026-11-20T07:40:00+00:00"
        assert session.sha256 == hashlib.sha256((SMALL / "session.yaml").read_bytes()).hexdigest()
        assert [len(session.in_state(state)) for state in RunState] == [1, 0, 6, 1]


def test_what_an_entry_says() -> None:
    session = read_session(SMALL)
    first, rejected = session.runs[:2]
    assert (first.test, first.direction, first.repeat, first.mounting) == ("a", Direction.CCW, 1, 1)
    assert first.program is None
    assert (rejected.state, rejected.reason, rejected.label) == (RunState.REJECTED, "operator", "a cw 1")
    assert rejected.program.path == SMALL / "programs" / "a-cw.ngc"
    assert rejected.program.model_sha256 == "c0" * 32
    assert session.circle(rejected).centre_mm == rejected.centre_mm != session.circle(first).centre_mm
    assert session.circle(rejected).ball_mm == session.circle(first).ball_mm
    assert session.started_s(first) == 0.0
    assert session.started_s(rejected) == 180.0


def test_runs_that_were_not_kept_moved_the_machine_too() -> None:
    session = read_session(SMALL)
    starts = [session.started_s(run) for run in session.runs]
    assert [began for began, _ in session.moving_s] == sorted(starts)
    circle = session.circle(session.runs[0])
    turn_s = (
        (360.0 + 2.0 * circle.overshoot_deg) / 360.0 * 2.0 * math.pi * circle.radius_mm / (circle.feed_mm_min / 60.0)
    )
    assert session.moving_s[0] == pytest.approx((0.0, turn_s))
    assert all(session.setup(run).moving_s == session.moving_s for run in session.runs)


def test_runs_share_a_mounting_by_number_or_by_test(session: Path) -> None:
    read = read_session(session)
    names = [read.setup(run).mounting for run in read.runs[:4]]
    assert names[0] == names[1] == names[2] != names[3]
    edit(session, "mounting: 1, ", "")
    edit(session, "mounting: 1, ", "")
    edit(session, "mounting: 1, ", "mounting: 2, ")
    read = read_session(session)
    names = [read.setup(run).mounting for run in read.runs[:4]]
    assert names[0] == names[1]
    assert len(set(names)) == 3
    assert len({read.setup(run).ball for run in read.runs[:3]}) == 1
    setup = read.setup(read.runs[0])
    assert (setup.mounting_repeatability_mm, setup.ball_uncertainty_mm) == (0.58e-3, 0.5e-3)
    # 150 mm of 10.6 µm/(m K): two temperatures of 0.3 K, and 5 % of what 0.1 K make.
    of_temperature = 150.0003 * 10.6e-6 * np.hypot(np.sqrt(2.0) * 0.3, 0.05 * 0.1)
    assert setup.bar_uncertainty_mm == pytest.approx(np.hypot(0.5e-3, of_temperature))


def test_runs_are_loaded_when_asked_for() -> None:
    session = read_session(SMALL)
    runs = session.load_all(session.in_state(RunState.ACCEPTED))
    assert len(runs) == 6
    assert all(len(run.recording) > 300 for run in runs)
    assert set(runs[0].recording.temperature_degc) == {"bar"}


def test_a_changed_file_is_named_among_all_other_faults(session: Path) -> None:
    path = session / "runs" / "a-ccw-1.csv"
    path.write_text(path.read_text().replace("151.4", "151.5", 1))
    edit(session, "state: accepted", "state: acepted")
    edit(session, "xy_radius_mm: 300", "xy_radius_mm: 0.3", "machine.yaml")
    (session / "runs" / "g-cw-1.csv").unlink()
    faults = faults_of(session)
    assert [name for name, *_ in faults] == ["machine.yaml", "a-ccw-1.csv", "session.yaml", "session.yaml"]
    assert faults[1][3] == "the file was changed after it was recorded: its SHA-256 is not the one in the session"
    assert "`acepted` is not one of" in faults[2][3]
    assert faults[3][3] == "there is no file `runs/g-cw-1.csv` in the session folder"


def test_a_file_that_changes_after_the_session_was_read(session: Path) -> None:
    read = read_session(session)
    path = session / "runs" / "a-ccw-1.csv"
    path.write_text(path.read_text().replace("151.4", "151.5", 1))
    with pytest.raises(InputError, match="was changed after it was recorded"):
        read.load(read.runs[0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("test: g", "test: z", "the plan has no test `z`: this is a run of another plan"),
        ("direction: ccw", "direction: left", "runs[0].direction: the text `left` is not one of 'ccw' or 'cw'"),
        ("repeat: 1", "repeat: 0", "runs[0].repeat: input should be greater than or equal to 1"),
        ("runs/a-ccw-1.csv", "../a-ccw-1.csv", "runs[0].file: `../a-ccw-1.csv` must be a path inside the session folder"),
        ("runs/a-ccw-1.csv", "/a.csv", "runs[0].file: `/a.csv` must be a path inside the session folder"),
        ("2026-11-20T08:00:00Z", "2026-11-20 at 8", "runs[0].started: `2026-11-20 at 8` is not a time with its zone"),
        ("2026-11-20T08:00:00Z", "2026-11-20T08:00:00", "runs[0].started: `2026-11-20T08:00:00` is not a time with its zone"),
        ("ambient_temp_c: 20.4", "ambient_temp_c: 293.5", "ambient_temp_c: 293.5 degC is not plausible, expected -30 to 80"),
        ("uncertainty_mm: 0.0005", "uncertainty_mm: 0.5", "bar.calibrator_uncertainty_mm: 0.5 mm is not plausible"),
        ("expansion_um_m_k: 10.6", "expansion_um_m_k: 1.06e-5", "bar.expansion_um_m_k: 1.06e-05 µm/(m K) is not plausible"),
        ("machine: machine.yaml", "machine: mashine.yaml", "there is no such file"),
    ],
)  # fmt: skip
def test_faults_of_a_session(session: Path, old: str, new: str, said: str) -> None:
    edit(session, old, new)
    assert any(what.startswith(said) for *_, what in faults_of(session))


def test_a_run_without_hash_is_refused_unless_it_was_being_recorded(session: Path) -> None:
    text = (session / "session.yaml").read_text()
    digest = read_session(session).runs[0].sha256
    (session / "session.yaml").write_text(text.replace(f", sha256: {digest}", ""))
    assert "the run is accepted but has no sha256" in faults_of(session)[0][3]


def test_duplicates_are_named_where_the_second_stands(session: Path) -> None:
    text = (session / "session.yaml").read_text()
    line = next(line for line in text.splitlines() if "test: g, direction: ccw" in line)
    (session / "session.yaml").write_text(text + line + "\n")
    faults = faults_of(session)
    last = text.count("\n") + 1
    assert [(place, column) for _, place, column, _ in faults] == [(last, 5), (last, 5)]
    assert {what.split(" (")[0] for *_, what in faults} == {"this file", "this run"}


def test_a_direction_that_the_plan_does_not_run(session: Path) -> None:
    edit(session, "directions: [ccw, cw]", "directions: [ccw]", "plan.yaml")
    faults = faults_of(session)
    assert {what for *_, what in faults} == {
        f"the plan does not run test {test} cw: this is a run of another plan" for test in "agl"
    }


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("# test: a", "# test: b"), "the file is test `b`, the session calls it test `a`"),
        (lambda text: text.replace("direction: ccw", "direction: cw"), "the file is direction `cw`, the session calls it"),
        (lambda text: text.replace("repeat: 1", "repeat: 2"), "the file is repeat `2`, the session calls it repeat `1`"),
    ],
)  # fmt: skip
def test_a_file_that_holds_another_run(session: Path, change, said: str) -> None:
    rewrite_run(session, "a-ccw-1.csv", change)
    assert load_faults(session, "a ccw 1")[0].startswith(said)


def plain(text: str, t_factor: float = 1.0, factor: float = 1.0, offset: float = 0.0) -> str:
    lines = text.splitlines()
    rows = [line.split(",") for line in lines[4:]]
    body = [f"{float(row[0]) * t_factor:.7f},{(float(row[1]) - offset) * factor:.9f}" for row in rows]
    return "\n".join([*lines[:3], "t_s,length_mm", *body]) + "\n"


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ({"factor": 1e-3}, "the plan's test a has a bar of 150 mm (it looks like m)"),
        ({"factor": 1 / 25.4}, "the plan's test a has a bar of 150 mm (it looks like inch)"),
        ({"factor": 6.0}, "length_mm is about 899.9"),
        ({"offset": 150.0}, "(it looks like a deviation from the radius)"),
        ({"t_factor": 1e3}, "a turn takes 56.5 s at the plan's feed"),
        ({"t_factor": 1 / 60}, "a turn takes 56.5 s at the plan's feed"),
    ],
)
def test_wrong_units_show_against_the_plan(session: Path, units: dict[str, float], said: str) -> None:
    rewrite_run(session, "a-ccw-1.csv", lambda text: plain(text, **units))
    faults = load_faults(session, "a ccw 1")
    assert len(faults) == 1
    assert said in faults[0]


def test_angles_in_radians_show(session: Path) -> None:
    rows = "".join(f"{i / 10:.1f},150.0,{6.28 * i / 600:.4f}\n" for i in range(600))
    rewrite_run(session, "a-ccw-1.csv", lambda _: "t_s,length_mm,theta_deg\n" + rows)
    assert "looks like rad" in load_faults(session, "a ccw 1")[0]


def test_all_runs_tell_their_faults_at_once(session: Path) -> None:
    for name in ("a-ccw-1.csv", "g-cw-1.csv"):
        rewrite_run(session, name, lambda text: plain(text, factor=1e-3))
    read = read_session(session)
    with pytest.raises(InputError) as caught:
        read.load_all(read.runs)
    assert [Path(problem.file).name for problem in caught.value.problems] == ["a-ccw-1.csv", "g-cw-1.csv"]


def test_half_recorded_runs_are_found_though_nobody_noted_them(session: Path) -> None:
    part = session / "runs" / "g-cw-7.csv.part"
    part.write_text("# test: g\n# direction: cw\n# repeat: 7\nt_s,length_mm\n0.0,151.5\n0.1,15")
    run = read_session(session).runs[-1]
    assert (run.label, run.state, run.path, run.sha256) == ("g cw 7", RunState.RECORDING, part, "")
    loaded = read_session(session).load(run)
    assert loaded.recording.length_mm.tolist() == [151.5]
    assert "cut off" in loaded.warnings[0].what
    part.write_text(part.read_text().replace("test: g", "test: z"))
    assert "this is a run of another plan" in faults_of(session)[0][3]
    part.write_text("# test: g\n# dir")
    assert len(read_session(session).runs) == 8


def test_no_session_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"this folder is no session: there is no session\.yaml in it"):
        read_session(tmp_path)
    with pytest.raises(InputError, match="there is no such file"):
        read_session(tmp_path / "nowhere")


@pytest.mark.parametrize(("name", "runs", "tests"), [("first-light", 30, 15), ("first-light-check", 16, 8)])
def test_sessions_made_elsewhere(recordings: Path, name: str, runs: int, tests: int) -> None:
    session = read_session(recordings / "sessions" / name)
    assert (len(session.runs), len(session.plan.tests)) == (runs, tests)
    session.plan.check(session.machine)
    loaded = session.load_all(session.in_state(RunState.ACCEPTED))
    assert {len(run.recording) for run in loaded} == {3679}
    assert not any(run.warnings for run in loaded)
