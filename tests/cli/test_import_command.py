"""`dbbstation import`: other people's tables into sessions that every command takes."""

from __future__ import annotations

import hashlib
import io
import json
import re

import numpy as np
import pytest

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.report.conditions import conditions

FIXTURES = shipped_folder("fixtures")
PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MACHINE = FIXTURES / "machines" / "reference.yaml"
MAPPING = FIXTURES / "mappings" / "every-key.yaml"
GERMAN = [FIXTURES / "foreign" / f"a_{word}.csv" for word in ("links", "rechts")]
ANGLE = ("--angle-grows", "ccw", "--angle-zero-deg", "0")
UNKNOWN = [word for one in ("temperature", "operator", "job", "bar") for word in ("--not-known", one)]
WHERE = ["--plan", PLAN, "--machine", MACHINE]
ANGLES = np.arange(360.0)


def raw_centre():
    """What a ball does that stands 5 and -3 µm beside its place: a circle without it was centred by another program."""
    return 5.0 * np.cos(np.radians(ANGLES)) - 3.0 * np.sin(np.radians(ANGLES))


def ellipse(amplitude_um=20.0):
    return amplitude_um * np.cos(np.radians(2.0 * ANGLES)) + raw_centre()


def table(path, rows, head="angle_deg,deviation_um", *, end="\n", encoding="utf-8"):
    path.write_bytes((head + end + end.join(rows) + end).encode(encoding))
    return path


def imported(run, file, out, *more):
    words = ["--out", out, *WHERE, *UNKNOWN, *ANGLE, "--zero-mm", "150"]
    return run("import", file, *words, "--runs", f"{file.name}=a-ccw", "--yes", *more)


def test_german_tables_are_a_session_with_the_circular_deviation_of_their_ellipse(run, tmp_path):
    """20 µm cos 2 theta has G = 40 µm; both directions are the same form."""
    out = tmp_path / "s"
    done = run("import", *GERMAN, "--out", out, *WHERE, *UNKNOWN, "--mapping", MAPPING, "--yes")
    assert done.code == DONE, done.err
    assert "words: " not in done.err
    checked = run("check", out)
    assert checked.code == DONE, checked.out
    assert "2 runs (2 accepted); sealed" in checked.out
    circles = run("circles", out, "--json").data
    assert [one["direction"] for one in circles["runs"]] == ["ccw", "cw"]
    for one in circles["runs"]:
        # Noise of 0.3 µm per reading widens a zone by a few of its standard deviations.
        assert one["g_um"] == pytest.approx(40.0, abs=1.5)
        assert one["centre_um"]["x"] == pytest.approx(5.0, abs=0.2)
    kept = out / "imported" / "files" / "a_links.csv"
    assert kept.read_bytes() == GERMAN[0].read_bytes()
    told = json.loads((out / "imported" / "provenance.json").read_text(encoding="utf-8"))
    assert told["inputs"]["a_links.csv"] == hashlib.sha256(GERMAN[0].read_bytes()).hexdigest()
    notes = [note.text for note in read_session(out).notes]
    assert any("computed from the angles at the plan's feed of 1000 mm/min" in text for text in notes)
    assert any("not stated: operator" in text for text in notes)


@pytest.mark.parametrize(
    ("head", "separator", "decimal", "end", "encoding", "factor"),
    [
        ("angle_deg,deviation_um", ",", ".", "\n", "utf-8", 1.0),
        ("angle_deg;deviation_um", ";", ",", "\r\n", "utf-8-sig", 1.0),
        ("angle_deg\tdeviation_in", "\t", ".", "\r\n", "utf-8", 1.0 / 25400.0),
        ("# made by hand\nserial: 7\n\nangle_deg;deviation_mm;", ";", ",", "\n", "utf-16", 1e-3),
        ("Program;1.0\nangle [rad];deviation [µinch]", ";", ".", "\n", "utf-8", 1.0 / 0.0254),
        ("angle,deviation\n(deg),(um)", ",", ".", "\r\n", "utf-8", 1.0),
    ],
)
def test_every_way_of_writing_gives_the_same_lengths(run, tmp_path, head, separator, decimal, end, encoding, factor):
    angles = np.radians(ANGLES) if "rad" in head else ANGLES
    tail = separator if head.endswith(";") else ""
    rows = [
        f"{a!r}{separator}{d * factor!r}{tail}".replace(".", decimal)
        for a, d in zip(angles.tolist(), ellipse().tolist(), strict=True)
    ]
    done = imported(run, table(tmp_path / "old.csv", rows, head, end=end, encoding=encoding), tmp_path / "s")
    assert done.code == DONE, done.err
    session = read_session(tmp_path / "s")
    recording = session.load(session.runs[0]).recording
    np.testing.assert_allclose(recording.length_mm, 150.0 + 1e-3 * ellipse(), rtol=0, atol=1e-10)
    np.testing.assert_allclose(recording.theta_deg, ANGLES, rtol=0, atol=1e-9)
    turn_s = 60.0 * 2.0 * np.pi * 150.0 / 1000.0
    np.testing.assert_allclose(recording.t_s, ANGLES / 360.0 * turn_s, rtol=1e-12)


@pytest.mark.slow
def test_a_machine_is_calibrated_from_imported_traces_as_from_its_own(run, tmp_path, fifteen, calibrated):
    """Whole traces of 15 circles as another program would write them: ms, inch, decimal comma, both directions in German."""
    session = read_session(fifteen)
    folder = tmp_path / "old"
    folder.mkdir()
    for one in session.runs:
        recording = session.load(one).recording
        rows = [
            f"{1e3 * t:.6f};{(length - 149.0) / 25.4:.12f}".replace(".", ",")
            for t, length in zip(recording.t_s.tolist(), recording.length_mm.tolist(), strict=True)
        ]
        name = f"{one.test}_{'links' if one.direction == 'ccw' else 'rechts'}.csv"
        table(folder / name, rows, "Zeit [ms];Abweichung [Zoll]", end="\r\n")
    mapping = tmp_path / "old.yaml"
    mapping.write_text(
        "format: dbb-mapping/1\nseparator: semicolon\ndecimal: ','\nzero_mm: 149.0\ntrace: whole\n"
        "file_name: '{test}_{direction}'\nwords: {links: ccw, rechts: cw}\n"
        "columns: {'Zeit [ms]': {means: time, unit: ms}, 'Abweichung [Zoll]': {means: deviation, unit: inch}}\n",
        encoding="utf-8",
    )
    out = tmp_path / "s"
    where = ["--plan", session.plan_path, "--machine", session.machine_path, *UNKNOWN, "--mapping", mapping, "--yes"]
    done = run("import", *sorted(folder.iterdir()), "--out", out, *where)
    assert done.code == DONE, done.err
    fit = run("calibrate", out, "--json")
    assert fit.code == DONE, fit.err
    assert fit.data["parameters_identified"] == calibrated[1].data["parameters_identified"]
    taken = read_session(out)
    for one, other in zip(sorted(session.runs, key=_key), sorted(taken.runs, key=_key), strict=True):
        own, there = session.load(one).recording, taken.load(other).recording
        np.testing.assert_allclose(there.length_mm, own.length_mm, rtol=0, atol=1e-9)
        np.testing.assert_allclose(there.t_s, own.t_s, rtol=0, atol=1e-9)


def test_a_mapping_is_kept_for_the_next_time_and_decides_then(run, tmp_path):
    rows = [f"{a:g},{d:g}" for a, d in zip(ANGLES, ellipse(), strict=True)]
    file, mapping = table(tmp_path / "old.csv", rows), tmp_path / "m.yaml"
    assert imported(run, file, tmp_path / "s", "--mapping", mapping).code == DONE
    assert run("check", mapping).code == DONE
    again = run(
        "import", file, "--out", tmp_path / "t", *WHERE, *UNKNOWN, "--mapping", mapping, "--runs", "old.csv=a", "--yes"
    )
    assert again.code == DONE, again.err
    one, other = ((tmp_path / name / "runs" / "a-ccw-1.csv").read_bytes() for name in ("s", "t"))
    assert one == other
    both = imported(run, file, tmp_path / "u", "--mapping", mapping)
    assert both.code == USAGE
    assert "edit it, or leave out --angle-zero-deg, --angle-grows, --zero-mm" in both.err


def settings(tmp_path, decimal, separator):
    path = tmp_path / "shop.yaml"
    path.write_text(f'format: dbb-settings/1\nnumbers: {{decimal: "{decimal}", separator: "{separator}"}}\n', "utf-8")
    return path


@pytest.mark.parametrize("mapped", [True, False])
def test_how_numbers_are_written_says_the_mapping_first_then_the_shop(run, tmp_path, mapped):
    mapping = tmp_path / "m.yaml"
    text = MAPPING.read_text("utf-8")
    mapping.write_text(text if mapped else re.sub(r"(?m)^(separator|decimal):.*\n", "", text), "utf-8")

    def done(name, *shop):
        out = tmp_path / name
        return run(*shop, "import", *GERMAN, "--out", out, *WHERE, *UNKNOWN, "--mapping", mapping, "--yes")

    assert done("looked").code == DONE
    here = settings(tmp_path, ".", ",")
    other = done("dots", "--settings", here)
    assert other.code == (DONE if mapped else FAILED)
    assert ("settings: --decimal ." in other.err) == (not mapped)
    assert ("--decimal and --separator say otherwise" in other.err) == (not mapped)
    there = settings(tmp_path, ",", ";")
    assert done("commas", "--settings", there).code == DONE
    one, last = ((tmp_path / name / "runs" / "a-ccw-1.csv").read_bytes() for name in ("looked", "commas"))
    assert one == last


def test_options_say_how_numbers_are_written_before_the_shop_and_not_beside_a_mapping(run, tmp_path):
    rows = [f"{a:.1f};{d:.4f}".replace(".", ",") for a, d in zip(ANGLES, ellipse(), strict=True)]
    file, shop = table(tmp_path / "old.csv", rows, "angle_deg;deviation_um"), settings(tmp_path, ".", ",")
    known = ["--settings", shop]
    words = ["--out", tmp_path / "s", *WHERE, *UNKNOWN, *ANGLE, "--zero-mm", "150", "--runs", "old.csv=a-ccw", "--yes"]
    refused = run(*known, "import", file, *words)
    assert (refused.code, "--decimal and --separator say otherwise" in refused.err) == (FAILED, True)
    assert run(*known, "import", file, *words, "--decimal", ",").code == DONE
    both = run("import", *GERMAN, "--out", tmp_path / "t", *WHERE, "--mapping", MAPPING, "--decimal", ",")
    assert (both.code, "leave out --decimal" in both.err) == (USAGE, True)


def test_what_this_program_exported_has_dots_whatever_the_shop_writes(run, tmp_path):
    out, told = tmp_path / "x.csv", settings(tmp_path, ",", ";")
    assert run("export", FIXTURES / "sessions" / "small", "--tests", "a", "--out", out).code == DONE
    words = ["--out", tmp_path / "s", *WHERE, *UNKNOWN, "--yes", "--dry-run"]
    found = run("--settings", told, "import", out, *words)
    assert found.code == DONE, found.err


def test_in_a_pipe_everything_that_is_missing_is_named_at_once(run, tmp_path):
    rows = [f"{a:g},{d:g}" for a, d in zip(ANGLES, ellipse(), strict=True)]
    done = run("import", table(tmp_path / "old.csv", rows, "Winkel,Abweichung [µm]"), "--out", tmp_path / "s")
    assert done.code == USAGE
    for option in ("'Winkel=angle:UNIT'", "--angle-grows", "--angle-zero-deg", "--zero-mm", "--plan", "--machine"):
        assert option in done.err
    for option in ("--ambient-temp-c", "--operator", "--job", "--bar"):
        assert f"{option}" in done.err
    assert not (tmp_path / "s").exists()


def test_nothing_is_written_without_yes_or_in_a_dry_run(run, tmp_path):
    words = ["import", *GERMAN, "--out", tmp_path / "s", *WHERE, *UNKNOWN, "--mapping", MAPPING]
    shown = run(*words)
    assert shown.code == USAGE
    assert "a-ccw-1" in shown.out
    assert "give --yes" in shown.err
    dry = run(*words, "--dry-run", "--json")
    assert dry.code == DONE
    assert dry.data["written"] is False
    assert [one["samples"] for one in dry.data["runs"]] == [360, 360]
    assert list(tmp_path.glob("*s*")) == []


def _key(run):
    return run.test, run.direction, run.repeat


def _rows(change):
    return [f"{a:g},{d:g}" for a, d in change(ANGLES, ellipse())]


@pytest.mark.parametrize(
    ("rows", "more", "what"),
    [
        (_rows(lambda a, d: zip(a[::-1], d, strict=True)), [], "the angles turn against ccw"),
        (_rows(lambda a, d: zip(a / 57.29578, d, strict=True)), [], "it may be angle in rad"),
        (_rows(lambda a, d: zip(a[:90], d[:90], strict=True)), [], "as run a-ccw-1"),
        (_rows(lambda a, d: zip(a, d + 150000.0, strict=True)), [], "none of a ball bar of 150 mm"),
        ([*_rows(lambda a, d: zip(a, d, strict=True)), "360,soon"], [], "old.csv:362:2: deviation_um is `soon`"),
        ([*_rows(lambda a, d: zip(a, d, strict=True)), "360"], [], "old.csv:362: 1 values in 2 columns"),
        (["1,2"], [], "there is no table of numbers"),
        ([], [], "there is no table of numbers"),
    ],
)
def test_tables_that_are_no_run_of_the_plan_are_refused_whole(run, tmp_path, rows, more, what):
    done = imported(run, table(tmp_path / "old.csv", rows), tmp_path / "s", *more)
    assert done.code == FAILED
    assert what in done.err
    assert "old.csv" in done.err
    assert [path.name for path in tmp_path.iterdir() if path.suffix != ".log"] == ["old.csv"]


def test_other_faults_of_words_are_answered(run, tmp_path):
    rows = _rows(lambda a, d: zip(a, d, strict=True))
    file = table(tmp_path / "old.csv", rows)
    words = ["import", file, "--out", tmp_path / "s", *WHERE, *UNKNOWN, *ANGLE, "--yes"]
    assert "no run of the plan" in run(*words, "--zero-mm", "150", "--runs", "old.csv=zz-ccw").err
    assert "0 of the given files have the name" in run(*words, "--zero-mm", "150", "--runs", "new.csv=a").err
    assert "nothing says which test" in run(*words, "--zero-mm", "150").err
    assert "--columns angel=angle:deg: the columns are" in run(*words, "--columns", "angel=angle:deg").err
    assert "write NAME=MEANING" in run(*words, "--columns", "angle_deg=angle:mm").err
    latin = tmp_path / "latin.csv"
    latin.write_bytes("Winkel [°],Abweichung [µm]\n".encode("cp1252") + "\n".join(rows).encode())
    refused = run("import", latin, "--out", tmp_path / "s")
    assert refused.code == FAILED
    assert "--encoding cp1252" in refused.err
    assert imported(run, latin, tmp_path / "s", "--encoding", "cp1252").code == DONE
    again = imported(run, latin, tmp_path / "s", "--encoding", "cp1252")
    assert again.code == FAILED
    assert "the session folder exists already" in again.err


def test_on_a_terminal_everything_that_is_missing_is_asked_for(run, tmp_path, monkeypatch):
    """Answers as they are typed, a decimal comma, a test that is none, and Enter where the answer is unknown."""
    rows = [f"{a:g},{d:g}" for a, d in zip(ANGLES, ellipse(), strict=True)]
    file = table(tmp_path / "old.csv", rows, "Winkel,Abweichung [µm]")
    answers = ["deg", "ccw", "0", "150", str(PLAN), str(MACHINE), "20,5", "Mori", "order 7", "", "zz", "a-ccw", "y"]
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(answers) + "\n"))
    monkeypatch.setattr("dbbstation.cli.asking.on_terminal", lambda: True)
    done = run("import", file, "--out", tmp_path / "s")
    assert done.code == DONE, done.err
    session = read_session(tmp_path / "s")
    assert (session.operator, session.job, session.ambient_temp_c, session.bar) == ("Mori", "order 7", 20.5, None)
    assert dict(conditions(session, [], ""))["job"] == "order 7"
    assert dict(conditions(session, [], "typed later"))["job"] == "typed later"
    assert [one.label for one in session.runs] == ["a ccw 1"]
    assert {note.text for note in session.notes} >= {"imported: not stated: bar"}
    assert "the plan's tests: a, b" in done.err


def test_what_is_not_confirmed_is_not_written(run, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    monkeypatch.setattr("dbbstation.cli.asking.on_terminal", lambda: True)
    done = run("import", *GERMAN, "--out", tmp_path / "s", *WHERE, *UNKNOWN, "--mapping", MAPPING)
    assert done.code == FAILED
    assert not list(tmp_path.glob("*s*"))


def test_a_span_that_is_not_the_plans_is_asked_for(run, tmp_path):
    """40 µm off centre and 5 µm too small, from 45 degrees before the turn to 45 behind it."""
    angles = np.arange(-60.0, 420.0, 1.0)
    rows = [f"{one:g},{40.0 * np.cos(np.radians(one)) - 5.0:.4f}" for one in angles]
    file = table(tmp_path / "wide.csv", rows)
    refused = imported(run, file, tmp_path / "no")
    assert refused.code == FAILED
    assert "the angles span 480 degrees, a turn of the plan has 360, with its overshoot 450" in refused.err
    assert "--angle-span-deg 480" in refused.err
    out = tmp_path / "s"
    done = imported(run, file, out, "--angle-span-deg", "480")
    assert done.code == DONE, done.err
    assert "its angles span 480 degrees, as was confirmed" in done.out
    (one,) = run("circles", out, "--json").data["runs"]
    assert one["samples"] == 360
    assert one["centre_um"]["x"] == pytest.approx(40.0, abs=0.02)
    assert one["mean_radial_error_um"] == pytest.approx(-5.0, abs=0.01)
