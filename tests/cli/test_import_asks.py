"""`dbbstation import`: dates, several runs in a file, units and centres that cannot be right, gaps."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from dbbstation.cli import DONE, FAILED
from dbbstation.files.recordings.session import read_session
from tests.cli.test_import_command import ANGLE, ANGLES, UNKNOWN, WHERE, ellipse, imported, raw_centre, table

FROM = [f"{a:g},{d:.4f}" for a, d in zip(ANGLES, ellipse(), strict=True)]
BACK = FROM[::-1]
EIGHT = datetime(2026, 11, 20, 7, 4, tzinfo=UTC)


def taken(run, file, out, *more):
    words = ["--out", out, *WHERE, *UNKNOWN, *ANGLE, "--zero-mm", "150", "--yes"]
    return run("import", file, *words, *more)


def runs_of(folder):
    session = read_session(folder)
    return {f"{one.test}-{one.direction}-{one.repeat}": one for one in session.runs}, session


@pytest.mark.parametrize(
    ("name", "head", "column", "more"),
    [
        ("old.csv", "angle_deg,deviation_um", "", ["--started", "2026-11-20T08:04+01:00"]),
        ("old.csv", "angle_deg,deviation_um", "", ["--started", "old.csv=20.11.2026 08:04", "--zone", "+01:00"]),
        ("old.csv", "Date: 20.11.2026 08:04\n\nangle_deg,deviation_um", "", ["--zone", "Europe/Berlin"]),
        ("old.csv", "Datum;20.11.2026\nUhrzeit;08:04:00\n\nangle_deg,deviation_um", "", ["--zone", "+01:00"]),
        ("old_2026-11-20_0804.csv", "angle_deg,deviation_um", "", ["--zone", "+01:00"]),
        ("old.csv", "angle_deg,deviation_um,started", ",2026-11-20T07:04:00Z", []),
        (
            "old.csv",
            "angle_deg,deviation_um,when",
            ",20.11.2026 08:04",
            ["--columns", "when=started", "--zone", "+01:00"],
        ),
    ],
)
def test_the_date_of_a_run(run, tmp_path, name, head, column, more):
    file = table(tmp_path / name, [row + column for row in FROM], head)
    done = imported(run, file, tmp_path / "s", *more)
    assert done.code == DONE, done.err
    runs, session = runs_of(tmp_path / "s")
    assert runs["a-ccw-1"].started == EIGHT
    if not column and "--started" not in more:
        assert any("date: from the" in note.text for note in session.notes)


def test_a_date_that_may_be_two_is_refused_with_its_line(run, tmp_path):
    file = table(tmp_path / "old.csv", FROM, "operator: Mori\nDate: 11/12/2026\n\nangle_deg,deviation_um")
    done = imported(run, file, tmp_path / "s")
    assert done.code == FAILED
    assert "old.csv:2" in done.err
    assert "--started" in done.err
    for day, why in (("2096-11-12", "which is still to come"), ("1970-01-01", "before there were ball bars")):
        done = imported(run, file, tmp_path / "s", "--started", f"{day}T08:00Z")
        assert done.code == FAILED
        assert f"this run is of {day}, {why}" in done.err
        assert not (tmp_path / "s").exists()
    assert imported(run, file, tmp_path / "s", "--started", "2026-11-12T08:00Z").code == DONE


def test_a_zone_that_nobody_says_is_said_to_be_the_computers(run, tmp_path):
    file = table(tmp_path / "old.csv", FROM, "Date: 2026-11-20 08:04\n\nangle_deg,deviation_um")
    done = imported(run, file, tmp_path / "s")
    assert done.code == DONE, done.err
    assert "that of this computer is taken" in done.out


def test_runs_that_turn_round_in_one_file_are_asked_about_and_parted(run, tmp_path):
    file = table(tmp_path / "old.csv", FROM + BACK + FROM)
    refused = taken(run, file, tmp_path / "s", "--runs", "old.csv=a")
    assert refused.code == FAILED
    assert "old.csv:362" in refused.err
    assert "--split direction" in refused.err
    done = taken(
        run, file, tmp_path / "s", "--runs", "old.csv=a", "--split", "direction", "--mapping", tmp_path / "m.yaml"
    )
    assert done.code == DONE, done.err
    runs, session = runs_of(tmp_path / "s")
    assert list(runs) == ["a-ccw-1", "a-cw-1", "a-ccw-2"]
    np.testing.assert_allclose(session.load(runs["a-cw-1"]).recording.theta_deg[0], 359.0, atol=1.01)
    assert "dbb-mapping/1" in (tmp_path / "m.yaml").read_text("utf-8")
    assert run("check", tmp_path / "m.yaml").code == DONE


def test_runs_with_pauses_between_them_are_named_in_order(run, tmp_path):
    """Times in seconds at the plan's feed: a turn of 150 mm at 1000 mm/min takes 56.5 s."""
    turn = ANGLES / 360.0 * 60.0 * 2.0 * np.pi * 150.0 / 1000.0
    rows = [f"{t + 0.0:.4f},{d:.4f}" for t, d in zip(turn, ellipse(), strict=True)]
    rows += [f"{t + 300.0:.4f},{d:.4f}" for t, d in zip(turn, ellipse()[::-1], strict=True)]
    file = table(tmp_path / "old.csv", rows, "t_s,deviation_um")
    words = [
        "--out",
        tmp_path / "s",
        *WHERE,
        *UNKNOWN,
        "--zero-mm",
        "150",
        "--yes",
        "--trace",
        "turn",
        "--split",
        "gaps",
    ]
    wrong = run("import", file, *words, "--runs", "old.csv=a-ccw,a-cw,b-ccw")
    assert wrong.code == FAILED
    assert "the file has 2 runs, and 3 are named" in wrong.err
    done = run("import", file, *words, "--runs", "old.csv=a-ccw,a-cw", "--started", "2026-11-20T07:04Z")
    assert done.code == DONE, done.err
    runs, _ = runs_of(tmp_path / "s")
    assert list(runs) == ["a-ccw-1", "a-cw-1"]
    assert (runs["a-cw-1"].started - runs["a-ccw-1"].started).total_seconds() == pytest.approx(300.0)


def test_a_column_that_counts_runs_parts_them(run, tmp_path):
    rows = [f"a-ccw,{row}" for row in FROM] + [f"a-cw,{row}" for row in BACK]
    file = table(tmp_path / "old.csv", rows, "Messung,angle_deg,deviation_um")
    done = taken(run, file, tmp_path / "s", "--columns", "Messung=run")
    assert done.code == DONE, done.err
    assert list(runs_of(tmp_path / "s")[0]) == ["a-ccw-1", "a-cw-1"]


@pytest.mark.parametrize(
    ("head", "factor", "says"),
    [
        ("angle_deg,deviation_um", 1e-3, "deviation:mm"),  # mm that are called µm: G was 0.0
        ("angle_deg,deviation_mm", 1.0, "deviation:µm"),
        ("angle_deg,length_mm", 1.0, "length:µm"),
        ("angle_rad,deviation_um", 1.0, "angle:deg"),
    ],
)
def test_a_unit_that_cannot_be_right_is_refused_with_the_one_that_may_be(run, tmp_path, head, factor, says):
    offset = 150000.0 if "length" in head else 0.0
    rows = [f"{a:g},{factor * d + offset:.6f}" for a, d in zip(ANGLES, ellipse(), strict=True)]
    if "rad" in head:
        rows = [f"{np.radians(a):.6f},{d:.4f}" for a, d in zip(ANGLES, ellipse(), strict=True)]
        head, says = "angle_deg,deviation_um", "angle:rad"
    done = imported(run, table(tmp_path / "old.csv", rows, head), tmp_path / "s")
    assert done.code == FAILED
    assert says in done.err
    assert "column " in done.err
    assert not (tmp_path / "s").exists()


def test_times_in_another_unit_are_noticed_by_the_feed(run, tmp_path):
    turn = ANGLES / 360.0 * 60.0 * 2.0 * np.pi * 150.0 / 1000.0
    rows = [f"{1e3 * t:.2f},{row}" for t, row in zip(turn, FROM, strict=True)]
    file = table(tmp_path / "old.csv", rows, "t_s,angle_deg,deviation_um")
    done = imported(run, file, tmp_path / "s")
    assert done.code == FAILED
    assert "time:ms" in done.err


def test_a_unit_may_be_trusted_and_the_session_notes_it(run, tmp_path):
    rows = [f"{a:g},{1e-3 * d:.6f}" for a, d in zip(ANGLES, ellipse(), strict=True)]
    done = imported(run, table(tmp_path / "old.csv", rows), tmp_path / "s", "--trust", "unit", "--trust", "centre")
    assert done.code == DONE, done.err
    assert any("taken as they are" in note.text for note in runs_of(tmp_path / "s")[1].notes)


def test_a_centre_that_was_taken_off_is_refused(run, tmp_path):
    centred = [f"{a:g},{d:.4f}" for a, d in zip(ANGLES, ellipse() - raw_centre(), strict=True)]
    file = table(tmp_path / "old.csv", centred)
    done = imported(run, file, tmp_path / "s")
    assert done.code == FAILED
    assert "took the centre off" in done.err
    assert "under-spindle" in done.err
    assert imported(run, file, tmp_path / "s", "--trust", "centre").code == DONE


def test_raw_circles_of_balls_that_stand_as_well_as_they_can_are_not_taken_for_centred(run, tmp_path):
    """A ball 0.3 µm beside its place: one that is put up to 1 µm does so once in twenty times."""
    near = [f"{a:g},{d:.4f}" for a, d in zip(ANGLES, ellipse() - 0.95 * raw_centre(), strict=True)]
    assert imported(run, table(tmp_path / "old.csv", near), tmp_path / "s").code == DONE


@pytest.mark.parametrize("word", ["", "OVER", "-OL-", "####", "NaN", "Overrange"])
def test_cells_without_a_reading_are_gaps(run, tmp_path, word):
    rows = list(FROM)
    for k in (40, 41, 200):
        rows[k] = f"{ANGLES[k]:g},{word}"
    done = imported(run, table(tmp_path / "old.csv", rows), tmp_path / "s")
    assert done.code == DONE, done.err
    assert "3 rows have no reading" in done.out
    runs, session = runs_of(tmp_path / "s")
    recording = session.load(runs["a-ccw-1"]).recording
    kept = np.delete(ANGLES, [40, 41, 200])
    np.testing.assert_allclose(recording.theta_deg, kept, atol=1e-9)
    np.testing.assert_allclose(recording.length_mm, 150.0 + 1e-3 * np.delete(ellipse(), [40, 41, 200]), atol=1e-7)


def test_a_slow_column_has_the_reading_before_a_gap(run, tmp_path):
    rows = [f"{row},{'20.5' if k % 10 == 0 else ''}" for k, row in enumerate(FROM)]
    rows[100] = rows[100].replace("20.5", "20.7")
    done = imported(run, table(tmp_path / "old.csv", rows, "angle_deg,deviation_um,bar_temp_c"), tmp_path / "s")
    assert done.code == DONE, done.err
    runs, session = runs_of(tmp_path / "s")
    warm = session.load(runs["a-ccw-1"]).recording.temperature_degc
    values = next(iter(warm.values()))
    assert values[99] == 20.5
    np.testing.assert_array_equal(values[100:110], 20.7)
    assert "rows without a reading have the one before" in done.out


def test_too_long_a_gap_is_no_circle(run, tmp_path):
    rows = [f"{a:g},{'OVER' if 100 <= a < 120 else f'{d:.4f}'}" for a, d in zip(ANGLES, ellipse(), strict=True)]
    done = imported(run, table(tmp_path / "old.csv", rows), tmp_path / "s")
    assert done.code == FAILED
    assert "no sample over" in done.err
