"""`dbbstation check` from the outside."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dbbstation.cli import main
from dbbstation.files.places import shipped_folder

FIXTURES = shipped_folder("fixtures")
PLANS = shipped_folder("protocols") / "plans"


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as left:
        main(["check", *map(str, arguments)])
    printed = capsys.readouterr()
    return int(left.value.code or 0), printed.out, printed.err


def test_everything_that_is_shipped_is_good(capsys) -> None:
    files = [
        *PLANS.glob("*.yaml"),
        *FIXTURES.glob("*/*.yaml"),
        *FIXTURES.glob("sessions/*/runs/*"),
        FIXTURES / "sessions" / "small",
    ]
    code, out, err = run(capsys, *files)
    assert (code, err) == (0, "")
    assert out.count("ok  ") == len(files) > 15
    assert "session: 8 runs (1 recording, 6 accepted, 1 rejected)" in out


def test_every_problem_of_every_file_and_no_traceback(capsys, tmp_path: Path) -> None:
    plan, machine = tmp_path / "plan.yaml", tmp_path / "machine.yaml"
    plan.write_text((PLANS / "table2.yaml").read_text().replace("radius_mm: 150.0", "radius_mm: 0.15"))
    machine.write_text((FIXTURES / "machines" / "reference.yaml").read_text().replace("travel:", "travels:"))
    code, out, err = run(capsys, plan, PLANS / "table2.yaml", machine, tmp_path / "none.yaml", tmp_path)
    assert code == 1
    assert out == f"ok  {PLANS / 'table2.yaml'}  plan Table II, fifteen circles: 15 tests\n"
    lines = err.splitlines()
    assert len(lines) == 5
    assert lines[0].startswith(f"{tmp_path}: this folder is no session")
    assert any(line.startswith(f"{plan}:") and "looks like m" in line for line in lines)
    assert any("the key `travels` is not known; did you mean `travel`?" in line for line in lines)
    assert any(line.endswith("none.yaml: there is no such file; check the path") for line in lines)


def test_json_says_the_same(capsys, tmp_path: Path) -> None:
    bad = tmp_path / "run.csv"
    bad.write_text("t_s,length_mm,note\n0,150,x\n0.1,nan,y\n")
    code, out, err = run(capsys, bad, PLANS / "table2.yaml", "--json")
    printed = json.loads(out)
    assert code == 1
    assert [(entry["format"], entry["ok"]) for entry in printed["files"]] == [("run", False), ("dbb-plan/1", True)]
    assert [(p["line"], p["file"]) for p in printed["problems"]] == [(3, str(bad))]
    assert f"{bad}:3: length_mm is `nan`, not a finite number" in err


def test_warnings_are_notes_and_no_failure(capsys, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = "".join(f"{k / 10},150,x\n" for k in range(8))
    path.write_text(f"t_s,length_mm,note\n{rows}")
    code, out, err = run(capsys, path)
    assert code == 0
    assert out.startswith("ok  ")
    assert err.startswith(f"note: {path}:1: the column `note` is not known")


def test_a_session_is_checked_with_runs_and_travel(capsys, tmp_path: Path) -> None:
    folder = tmp_path / "small"
    shutil.copytree(FIXTURES / "sessions" / "small", folder)
    machine = folder / "machine.yaml"
    machine.write_text(machine.read_text().replace("xy_radius_mm: 300", "xy_radius_mm: 200"))
    code, out, err = run(capsys, folder)
    assert (code, out) == (1, "")
    assert "plan.yaml: test a" in err or "plan.yaml: test g" in err
    assert "the distance from the Z axis is" in err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name: x\n", "the file does not say what format it has"),
        ("format: dbb-thing/1\n", "`dbb-thing/1` is no format"),
        ("format: dbb-plan/9\n", "`dbb-plan/9` is a version that this program does not know"),
        ("[1]\n", "the file does not say what format it has"),
    ],
)
def test_files_of_no_format(capsys, tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text)
    code, _, err = run(capsys, path)
    assert code == 1
    assert said in err


def test_files_of_other_commands_are_led_to_them(capsys) -> None:
    part, sheet = FIXTURES / "nc" / "part.ngc", FIXTURES / "cmm" / "plate.dmo"
    code, _, err = run(capsys, part, sheet)
    assert code == 1
    assert "this is an NC program, which `check` does not read; use `dbbstation compensate" in err
    assert "this is a CMM sheet, which `check` does not read; use `dbbstation jig sheet" in err


def test_usage_errors_are_2(capsys) -> None:
    assert run(capsys)[0] == 2
    assert run(capsys, "--schema", "dbb-nothing/1")[0] == 2
    assert run(capsys, "--schema", "dbb-plan/1", "x.yaml")[0] == 2


def test_the_schema_is_printed(capsys) -> None:
    code, out, _ = run(capsys, "--schema", "dbb-machine/1")
    schema = json.loads(out)
    assert code == 0
    assert schema["properties"]["joint_tolerance_mm"]["description"].startswith("Standard deviation of each base-joint")


def test_help_imports_neither_schemas_nor_mathematics() -> None:
    program = (
        "import sys\nfrom dbbstation.cli import main\n"
        "try:\n    main(['check', '--help'])\nexcept SystemExit:\n    pass\n"
        "print([name for name in ('numpy', 'numba', 'pydantic', 'ruamel.yaml') if name in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert done.stdout.endswith("[]\n")


def test_samples_that_a_run_lost_are_named(capsys, tmp_path: Path) -> None:
    """A sampled run of 400 rows without 20 of them, in one piece."""
    session = tmp_path / "session"
    shutil.copytree(FIXTURES / "sessions" / "small", session)
    path = session / "runs" / "a-ccw-1.csv"
    rows = [f"{k * 0.1:.3f},150.0,{360.0 * k / 399:.4f}" for k in range(400) if not 100 <= k < 120]
    path.write_text("t_s,length_mm,theta_deg\n" + "\n".join(rows) + "\n")
    text = (session / "session.yaml").read_text()
    noted = text.split("a-ccw-1.csv")[1].split("sha256: ")[1][:64]
    (session / "session.yaml").write_text(text.replace(noted, hashlib.sha256(path.read_bytes()).hexdigest()))
    code, _, err = run(capsys, session)
    assert code == 0, err
    assert err.count("samples were lost") == 1
    assert "a-ccw-1.csv: 20 of 400 samples were lost (5 %), more than the 0.5 % that the plan allows" in err
    assert run(capsys, path)[1].endswith("run: 380 samples in 39.9 s, 20 lost\n")


def test_readings_that_no_bar_has_are_told_of_the_whole_file(capsys, tmp_path: Path) -> None:
    """A deviation in place of the length: the sample stands in the text, as its line does not depend on the format."""
    rows = [f"{0.1 * k:.1f},{150.0 if k < 40 else 0.25}" for k in range(60)]
    bad = tmp_path / "run.csv"
    bad.write_text("\n".join(["t_s,length_mm", *rows, ""]))
    code, _, err = run(capsys, bad)
    assert code == 1
    assert err.startswith(f"{bad}: length_mm is 0.25 in sample 41, expected ")
    assert "; 19 more are so" in err
