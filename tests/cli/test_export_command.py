"""`dbbstation export`: sessions as one tidy table, and back again sample by sample."""

from __future__ import annotations

import csv
import json
import re
import sys
import tracemalloc

import numpy as np
import pytest
from pyarrow import parquet

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.trace.cut import cut
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

SEALED = shipped_folder("fixtures") / "sessions" / "logged"
SMALL = shipped_folder("fixtures") / "sessions" / "small"


def rows_of(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def same_samples(one, other):
    whole = [run for run in one.runs if run.state != "recording"]
    assert [run.label for run in whole] == [run.label for run in other.runs]
    for own, there in zip(whole, other.runs, strict=True):
        a, b = one.load(own).recording, other.load(there).recording
        assert (own.state, own.mounting, own.started) == (there.state, there.mounting, there.started)
        np.testing.assert_array_equal(a.t_s, b.t_s)
        np.testing.assert_array_equal(a.length_mm, b.length_mm)
        assert (a.theta_deg is None) == (b.theta_deg is None)
        if a.theta_deg is not None:
            np.testing.assert_array_equal(a.theta_deg, b.theta_deg)
        assert set(a.logged) == set(b.logged)
        for name, values in a.logged.items():
            np.testing.assert_array_equal(values, b.logged[name])
        if a.usable is not None:
            np.testing.assert_array_equal(a.usable, b.usable)


def brought_back(run, table, session, out):
    unknown = [word for one in ("temperature", "operator", "job", "bar") for word in ("--not-known", one)]
    where = ["--plan", session.plan_path, "--machine", session.machine_path]
    done = run("import", table, "--out", out, *where, *unknown, "--yes")
    assert done.code == DONE, done.err
    return read_session(out)


@pytest.mark.parametrize("name", ["logged", "small", "under-spindle"])
def test_a_session_that_went_out_and_came_in_again_has_the_same_samples(run, tmp_path, name):
    folder = shipped_folder("fixtures") / "sessions" / name
    table = tmp_path / "t.csv"
    assert run("export", folder, "--out", table).code == DONE
    session = read_session(folder)
    same_samples(session, brought_back(run, table, session, tmp_path / "s"))


def test_awkward_numbers_come_back_too(run, tmp_path, spoilt):
    session = read_session(spoilt.folder)
    file = session.runs[0].path.relative_to(spoilt.folder).as_posix()
    rng = np.random.default_rng(4)

    def more(lines):
        top = next(k for k, line in enumerate(lines) if line.startswith("t_s"))
        out = [*lines[:top], "t_s,length_mm,bar_temp_c,status\n"]
        for line in lines[top + 1 :]:
            if line.startswith("#"):
                out.append(line)
                continue
            t, length = (float(cell) for cell in line.split(",")[:2])
            out.append(
                f"{t!r},{length + rng.normal(0, 1e-9)!r},{20.0 + rng.normal(0, 0.1)!r},{rng.choice(['ok', 'overrange'], p=[0.999, 0.001])}\n"
            )
        return out

    spoilt.lines(file, more)
    (spoilt.folder / "session.yaml").write_text(_unsealed(spoilt.folder), encoding="utf-8")
    table = tmp_path / "t.csv"
    done = run("export", spoilt.folder, "--out", table)
    assert done.code == DONE, done.err
    session = read_session(spoilt.folder)
    same_samples(session, brought_back(run, table, session, tmp_path / "s"))


def _unsealed(folder):
    """The text of a session file without its seal and links, as of one that was written by hand."""
    text = (folder / "session.yaml").read_text(encoding="utf-8")
    text = re.sub(r"^seal:\n(  .*\n)+", "", text, flags=re.MULTILINE)
    return re.sub(r", chain_sha256: [0-9a-f]+", "", text)


def test_rows_say_angle_and_deviation_as_the_circle_has_them(run, tmp_path):
    table = tmp_path / "t.csv"
    assert run("export", SEALED, "--out", table, "--tests", "a", "--states", "accepted").code == DONE
    session = read_session(SEALED)
    rows = rows_of(table)
    assert {row["test"] for row in rows} == {"a"}
    one = next(run for run in session.runs if run.test == "a")
    mine = [row for row in rows if (row["direction"], row["repeat"]) == (one.direction, str(one.repeat))]
    circle, recording = session.circle(one), session.load(one).recording
    raw = cut(recording, circle)
    angle = np.array([float(row["angle_deg"]) for row in mine if row["angle_deg"]])
    assert len(angle) == len(raw.theta_deg)
    np.testing.assert_allclose(np.cos(np.radians(angle - raw.theta_deg)), 1.0, atol=1e-12)
    deviation = np.array([float(row["deviation_um"]) for row in mine])
    np.testing.assert_allclose(deviation, 1e3 * (recording.length_mm - circle.bar_mm), rtol=0, atol=1e-9)
    told = json.loads((tmp_path / "t.csv.provenance.json").read_text(encoding="utf-8"))
    assert told["inputs"]["logged/session.yaml"] == session.sha256
    assert "µm" in told["columns"]["deviation_um"]


def test_parquet_has_the_same_values_with_meaning_and_origin(run, tmp_path):
    done = run("export", SEALED, "--out", tmp_path / "t.parquet", "--json")
    assert done.code == DONE, done.err
    assert run("export", SEALED, "--out", tmp_path / "t.csv").code == DONE
    file = parquet.ParquetFile(tmp_path / "t.parquet")
    assert file.num_row_groups == done.data["runs"] == len(read_session(SEALED).runs)
    table, rows = file.read().to_pydict(), rows_of(tmp_path / "t.csv")
    assert list(table) == list(rows[0])
    for name, values in table.items():
        texts = [row[name] for row in rows]
        assert ["" if value is None else value if isinstance(value, str) else str(value) for value in values] == texts
    told = json.loads(file.metadata.metadata[b"dbbstation"])
    assert told["command"].startswith("dbbstation export logged")
    assert file.schema_arrow.field("deviation_um").metadata[b"meaning"]


def test_without_pyarrow_it_says_what_to_install(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    done = run("export", SEALED, "--out", tmp_path / "t.parquet")
    assert done.code == FAILED
    assert "pip install 'dbbstation[parquet]'" in done.err
    assert not (tmp_path / "t.parquet").exists()


def test_memory_is_that_of_one_run(run, tmp_path):
    peaks = []
    for repeats in (1, 3):
        folder = tmp_path / f"s{repeats}"
        record(folder, seed=1, plan=subset(table_ii_plan(1), "abc"[:repeats]), mechanisms=[], rate_hz=20.0)
        run("export", folder, "--out", tmp_path / "warm.csv", "--force")
        tracemalloc.start()
        assert run("export", folder, "--out", tmp_path / f"{repeats}.csv").code == DONE
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.33 * peaks[0]


def test_bad_words_are_answered_and_nothing_is_replaced(run, tmp_path, spoilt):
    table = tmp_path / "t.csv"
    assert run("export", SEALED, "--out", tmp_path / "t.xlsx").code == USAGE
    table.write_text("mine", encoding="utf-8")
    assert "--force" in run("export", SEALED, "--out", table).err
    assert table.read_text(encoding="utf-8") == "mine"
    spoilt.lines("runs/l-cw-1.csv", lambda lines: [*lines[:40], "1,2,3,4,5,6\n", *lines[41:]], reseal=False)
    broken = run("export", spoilt.folder, "--out", table, "--force")
    assert broken.code == FAILED
    assert "l-cw-1.csv" in broken.err
    assert table.read_text(encoding="utf-8") == "mine"
    assert "no run is left" in run("export", SMALL, "--out", tmp_path / "u.csv", "--states", "complete").err
    assert run("export", SEALED, "--out", tmp_path / "u.csv", "--tests", "zz").code == FAILED
