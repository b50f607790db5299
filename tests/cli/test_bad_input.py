"""Whatever is wrong with files: one clear message with its place, exit code 1, no traceback, nothing written."""

from __future__ import annotations

import hashlib
import re
import shutil
from pathlib import Path

import pytest

from dbbstation.cli import FAILED
from dbbstation.files.places import shipped_folder

RUN = "runs/a-ccw-1.csv"


@pytest.fixture
def refused(run, spoilt):
    """Calibrate the spoilt session, expecting to fail; give back the message with the session's folder left out."""

    def refuse(*arguments) -> str:
        before = contents(spoilt.folder.parent)
        outcome = run("calibrate", spoilt.folder, "--out", spoilt.folder.parent / "model.yaml", *arguments)
        assert outcome.code == FAILED
        assert outcome.out == ""
        assert "Traceback" not in outcome.err
        assert "fault of dbbstation" not in outcome.err
        assert contents(spoilt.folder.parent) == before
        return outcome.err.replace(f"{spoilt.folder}/", "").replace(str(spoilt.folder), "SESSION")

    return refuse


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def with_line(number, text):
    """Put a text in place of a line, counted from 1."""
    return lambda lines: [*lines[: number - 1], text, *lines[number:]]


def test_nan(spoilt, refused):
    spoilt.lines(RUN, with_line(41, "7.2000,nan\n"))
    assert refused().startswith(f"{RUN}:41: length_mm is `nan`, not a finite number; ")


def test_every_bad_line_of_every_run_is_told(spoilt, refused):
    spoilt.lines(RUN, with_line(41, "7.2000,nan\n"))
    spoilt.lines(RUN, with_line(50, "9.0000\n"))
    spoilt.lines("runs/g-cw-1.csv", with_line(60, "11.0000,15O.0012\n"))
    told = refused().splitlines()
    assert [line.split(": ")[0] for line in told] == [f"{RUN}:41", f"{RUN}:50", "runs/g-cw-1.csv:60"]


def test_truncated(spoilt, refused):
    spoilt.lines(RUN, lambda lines: lines[: len(lines) // 2])
    assert refused().startswith(f"{RUN}: no feed-out found: ")


def test_a_cut_off_last_line_costs_that_line_alone(run, spoilt):
    path = spoilt.lines(RUN, lambda lines: [*lines[:-1], lines[-1][:5]])
    outcome = run("calibrate", spoilt.folder, "--json")
    assert outcome.code == 0
    assert re.search(rf"{re.escape(str(path))}:\d+: the last line was cut off", outcome.err)


def test_reordered(spoilt, refused):
    spoilt.lines(RUN, lambda lines: [*lines[:50], *lines[80:100], *lines[50:80], *lines[100:]])
    assert refused().startswith(f"{RUN}:71: time runs backwards here: ")


def test_a_run_of_another_plan(spoilt, refused):
    shutil.copy(shipped_folder("protocols") / "plans" / "gravity-conditions.yaml", spoilt.path("plan.yaml"))
    told = refused()
    line = spoilt.line_of("session.yaml", "a-ccw-1")
    assert f"session.yaml:{line}:" in told
    assert "the plan has no test `a`: this is a run of another plan" in told


def test_the_file_of_another_run(spoilt, refused):
    text = spoilt.path("runs/g-ccw-1.csv").read_text(encoding="utf-8")
    spoilt.lines(RUN, lambda _: text.splitlines(keepends=True))
    assert refused().startswith(f"{RUN}: the file is test `g`, the session calls it test `a`; ")


@pytest.mark.parametrize(
    ("column", "change", "what"),
    [
        (1, lambda mm: mm / 1000, "(it looks like m); give the whole distance between the balls in mm"),
        (1, lambda mm: mm * 1000, ":5: length_mm is 151698, sizes up to 10000 mm are plausible; check the unit"),
        (1, lambda mm: mm - 150, "(it looks like a deviation from the radius)"),
        (1, lambda mm: 1000 * (mm - 150), "nothing taken off"),
        (0, lambda s: s * 1000, "give t_s in seconds"),
    ],
    ids=["length in m", "length in µm", "deviation in mm", "deviation in µm", "time in ms"],
)
def test_wrong_units(spoilt, refused, column, change, what):
    spoilt.column(RUN, column, change)
    told = refused()
    assert told.startswith(RUN)
    assert what in told


def test_machine_in_metres(spoilt, refused):
    text = spoilt.path("machine.yaml").read_text(encoding="utf-8")
    metres = re.sub(r"-?\d+\.\d+", lambda found: str(float(found[0]) / 1000), text)
    spoilt.path("machine.yaml").write_text(metres, encoding="utf-8")
    line = spoilt.line_of("machine.yaml", "base_joints_mm")
    told = refused()
    assert re.search(rf"machine\.yaml:{line}:\d+: base_joints_mm\[0\]: .*\(it looks like m\); check the unit", told)


@pytest.mark.parametrize(
    ("file", "old", "new", "what"),
    [
        ("session.yaml", "runs:", "runs: [", "not YAML: "),
        ("machine.yaml", "rotation:", "rotation", "not YAML: "),
        ("machine.yaml", "name:", "name: twice\nname:", "the key `name` stands here a second time"),
        ("machine.yaml", "screw_lead_mm", "screw_led_mm", "`screw_led_mm` is not known; did you mean `screw_lead_mm`?"),
        ("session.yaml", "machine:", "machin:", "the key `machin` is not known; did you mean `machine`?"),
        ("plan.yaml", "dbb-plan/1", "dbb-plan/9", "`dbb-plan/9` is a version that this program does not know"),
    ],
    ids=["brackets", "no colon", "a key twice", "unknown key", "unknown and missing key", "later version"],
)
def test_faults_of_yaml_files(spoilt, refused, file, old, new, what):
    spoilt.replace(file, old, new)
    told = refused()
    assert re.search(rf"^{re.escape(file)}:\d+:\d+: .*{re.escape(what)}", told, re.MULTILINE), told


def test_missing_run(spoilt, refused):
    spoilt.path(RUN).unlink()
    line = spoilt.line_of("session.yaml", RUN)
    assert re.match(rf"session\.yaml:{line}:\d+: there is no file `{RUN}` in the session folder; restore it", refused())


@pytest.mark.parametrize("file", ["machine.yaml", "plan.yaml"])
def test_missing_file(spoilt, refused, file):
    spoilt.path(file).unlink()
    assert refused() == f"{file}: there is no such file; check the path\n"


def test_changed_run(spoilt, refused):
    spoilt.lines(RUN, with_line(41, "7.2000,150.1\n"), reseal=False)
    assert refused().startswith(f"{RUN}: the file was changed after it was recorded: its SHA-256 is not the one in")


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"G21 G90\nG1 X0 Y0 Z-1000 A0 B0 C0 F1000\nG1 Q\n", r":3:\d+: "),
        (b"G21 G90\nG1 X0 Y0 Z-1000 A0 B0 C0 F1000\nG1 X10\nM2\n", ": its longest move at feed takes "),
        (b"(\xe4)\nM2\n", r":1:2: byte 0xe4 is not UTF-8 text"),
    ],
    ids=["no NC text", "another program", "not UTF-8"],
)
def test_a_program_that_was_not_this_run(spoilt, refused, content, what):
    spoilt.path("programs").mkdir()
    spoilt.path("programs/a-ccw.ngc").write_bytes(content)
    digest = hashlib.sha256(content).hexdigest()
    run_hash = hashlib.sha256(spoilt.path(RUN).read_bytes()).hexdigest()
    entry = f"{run_hash}, program: {{file: programs/a-ccw.ngc, sha256: {digest}}}"
    spoilt.replace("session.yaml", run_hash, entry)
    assert re.match(rf"programs/a-ccw\.ngc{what}", refused())


def test_one_test(refused):
    told = refused("--exclude", "a", "--exclude", "g")
    assert told.startswith("1 test cannot calibrate a machine: at least 3 at different places are needed")


def test_sessions_of_two_machines(run, spoilt, tmp_path):
    shutil.copytree(spoilt.folder, tmp_path / "other")
    text = spoilt.path("machine.yaml").read_text(encoding="utf-8")
    first = re.search(r"base_joints_mm: \[\[(-?[\d.]+)", text)[1]
    spoilt.replace("machine.yaml", first, str(float(first) + 1.0))
    outcome = run("calibrate", tmp_path / "other", spoilt.folder, "--out", tmp_path / "model.yaml")
    assert outcome.code == FAILED
    assert outcome.err.startswith(f"{spoilt.folder / 'machine.yaml'}: its machine file is not that of ")
    assert "is not that of" in outcome.err
    assert not (tmp_path / "model.yaml").exists()


def test_a_session_and_its_copy(run, spoilt, tmp_path):
    copy = shutil.copytree(spoilt.folder, tmp_path / "copy")
    for file in ("session.yaml", "machine.yaml", "plan.yaml"):  # annotated: other bytes, the same recordings
        (copy / file).write_text("# a copy\n" + (copy / file).read_text("utf-8"), "utf-8")
    for twice in (spoilt.folder, copy):
        outcome = run("calibrate", spoilt.folder, twice, "--out", tmp_path / "model.yaml")
        assert outcome.code == FAILED
        assert outcome.err.endswith(
            f"{twice}: 6 runs repeat recordings of {spoilt.folder}; give every recording once\n"
        )
    assert not (tmp_path / "model.yaml").exists()


def test_the_folder_of_the_model_is_missing(refused):
    told = refused("--out", "nowhere/model.yaml")
    assert told.startswith("nowhere/model.yaml: cannot be written: there is no folder nowhere")


def test_unknown_source(refused):
    told = refused("--sources", "strut-reference-length,base-joint")
    assert told.startswith("no error source is called 'base-joint'; did you mean base-joints?")


@pytest.mark.parametrize("sources", ["mounting", ",", " "])
def test_nothing_to_fit(refused, sources):
    assert "no named error source belongs to the machine" in refused("--sources", sources)


def test_several_excluded_tests_in_one_word(refused):
    assert refused("--exclude", "a,g").startswith("1 test cannot calibrate a machine")


def test_unknown_excluded_test(refused):
    assert refused("--exclude", "z") == "SESSION: no session has a test z to exclude; tests are a, g, l\n"


def test_nothing_left(refused):
    told = refused(*(word for test in "agl" for word in ("--exclude", test)))
    assert told.startswith("SESSION: no accepted run is left; ")


def test_no_session_there(run, tmp_path):
    empty = tmp_path / "shop" / "empty"
    empty.mkdir(parents=True)
    outcome = run("calibrate", empty)
    assert outcome.code == FAILED
    what = "this folder is no session: there is no session.yaml in it; name a session folder"
    assert outcome.err == f"{empty}: {what}\n"


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        (r"\bbase-joints\b", "base-joint", r":\d+:\d+: no error source is called `base-joint`; did you mean"),
        (r"unit: mm", "unit: m", r":\d+:\d+: strut-reference-length strut_1_mm is in mm, not in m; "),
        (r"strut_1_mm: \{value: [^,]+", "strut_1_mm: {value: .nan", r":\d+:\d+: .* a number was expected, not `nan`"),
        (r"strut_1_mm: \{[^}]+\}, ", "", r":\d+:\d+: .*`strut_1_mm` of strut-reference-length is missing"),
        (r"matrix:\n    - \[(.*?), ", r"matrix:\n    - [-1.0, ", r":\d+:\d+: covariance"),
        (r"matrix:\n    - .*\n", "matrix:\n", r":\d+:\d+: covariance"),
        (r"(?s)(matrix:.{500}).*", r"\1", r":\d+:\d+: not YAML"),
        (r"dbb-model/\d", "dbb-model/9", r":\d+:\d+: `dbb-model/9` is a version that this program does not know"),
    ],
    ids=["source", "unit", "value", "parameter", "variance", "matrix", "cut off", "version"],
)
def test_model_tampered_with(run, tmp_path, model, elsewhere, old, new, what):
    text, count = re.subn(old, new, model.read_text(encoding="utf-8"), count=1)
    assert count == 1
    bad = tmp_path / "model.yaml"
    bad.write_text(text, encoding="utf-8")
    outcome = run("evaluate", elsewhere, "--model", bad)
    assert (outcome.code, outcome.out) == (FAILED, "")
    assert re.search(rf"^{re.escape(str(bad))}({what})", outcome.err, re.MULTILINE), outcome.err


def test_files_in_each_others_places(run, fifteen, model):
    outcome = run("evaluate", fifteen, "--model", fifteen / "machine.yaml")
    assert outcome.code == FAILED
    assert "this file is a machine (`dbb-machine/1`), a model (`dbb-model/1`) was expected" in outcome.err
    outcome = run("calibrate", model)
    assert outcome.code == FAILED
    assert "this file is a model (`dbb-model/1`), a session (`dbb-session/1`) was expected" in outcome.err


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("x_mm,y_mm\n1,2\n", ":1: there is no column `c_deg`; columns here: x_mm, y_mm"),
        ("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n", ":1: there are no rows below this line"),
        (
            "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n0,0,-1008,0,0,nan\n",
            ":3: c_deg is `nan`, not a finite number",
        ),
        ("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n900,0,-1008,0,0,0\n", "its travel 0 to 300 mm"),
    ],
)
def test_poses(run, tmp_path, model, text, what):
    poses = tmp_path / "in.csv"
    poses.write_text(text)
    outcome = run("predict", "--model", model, poses, "--table", tmp_path / "out.csv")
    assert outcome.code == FAILED
    assert outcome.err.startswith(str(poses))
    assert what in outcome.err
    assert not (tmp_path / "out.csv").exists()


def test_a_model_of_another_machine_writes_no_programs(run, tmp_path, model):
    machine = shipped_folder("fixtures") / "machines" / "greatest-feed.yaml"
    plan = shipped_folder("protocols") / "plans" / "table2.yaml"
    files = ["--plan", plan, "--machine", machine, "--model", model]
    outcome = run("program", *files, "--out", tmp_path / "nc")
    assert outcome.code == FAILED
    assert "another nominal machine" in outcome.err
    assert not (tmp_path / "nc").exists()


def test_an_output_never_takes_the_place_of_an_input(run, spoilt):
    """`--force` is for results of an earlier command: a session's own files are not its results."""
    plan = (spoilt.folder / "plan.yaml").read_bytes()
    outcome = run("calibrate", spoilt.folder, "--out", spoilt.folder / "plan.yaml", "--force")
    assert (outcome.code, outcome.out) == (FAILED, "")
    assert "this lies in the session" in outcome.err
    assert (spoilt.folder / "plan.yaml").read_bytes() == plan


def test_an_output_never_takes_the_place_of_a_file_that_was_read(run, tmp_path, model):
    copy = Path(shutil.copyfile(model, tmp_path / "copy.yaml"))
    before = copy.read_bytes()
    session = shipped_folder("fixtures") / "sessions" / "small"
    outcome = run("report", session, "--model", copy, "--page", copy, "--force")
    assert outcome.code == FAILED
    assert copy.read_bytes() == before


def test_two_outputs_of_one_name_are_refused_before_the_work(run, spoilt, tmp_path):
    same = tmp_path / "x.svg"
    outcome = run("calibrate", spoilt.folder, "--out", same, "--figure", same, "--force")
    assert outcome.code == FAILED
    assert "two outputs have this name" in outcome.err
    assert not same.exists()
