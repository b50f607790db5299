"""What `import dbbstation as dbb` offers: it is loaded when it is used, and does not change without a word."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import dbbstation as dbb
from dbbstation.files.places import shipped_folder
from tests.public_names import kept, lines_told, signatures

SMALL = shipped_folder("fixtures") / "sessions" / "small"


def test_no_signature_changes_without_a_line_in_the_changelog():
    count, before = kept()
    assert signatures() == before, "keep them anew with `python -m tests.public_names`, and say it in the changelog"
    assert lines_told() >= count


def test_nothing_heavy_is_loaded_before_it_is_used():
    script = (
        "import sys, dbbstation as dbb; dir(dbb);"
        "sys.exit(','.join({'numpy', 'scipy', 'numba', 'pydantic', 'matplotlib', 'click'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""


def test_names_and_their_types_are_the_same():
    """`__init__.pyi` is what a type checker reads in place of the code that loads names."""
    stub = ast.parse(Path(dbb.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imported = {
        alias.asname: node.module for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert sorted([*imported, "__version__"]) == sorted(dbb.__all__)
    for name, module in imported.items():
        assert getattr(dbb, name) is getattr(sys.modules[module], name)
    assert (Path(dbb.__file__).parent / "py.typed").exists()


def test_every_public_function_says_what_it_takes_and_raises():
    for name in dbb.__all__:
        one = getattr(dbb, name)
        if inspect.isfunction(one):
            asked = [each for each in inspect.signature(one).parameters if each != "folder"]
            for parameter in asked:
                assert f"    {parameter}: " in one.__doc__, f"{name}: {parameter}"


def test_a_name_that_is_not_there():
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        _ = dbb.calibrat


@pytest.mark.parametrize("kind", [np.float32, np.int64, list])
def test_poses_may_be_numbers_of_any_type(kind):
    model = dbb.read_model(shipped_folder("fixtures") / "models" / "small.yaml")
    poses = [[0, 0, -1000, 0, 0, 0], [10, 0, -1000, 1, 0, 0]]
    given = poses if kind is list else np.array(poses, dtype=kind)
    expected = dbb.predict(model, np.array(poses, dtype=float))
    assert np.array_equal(dbb.predict(model, given).actual, expected.actual)
    assert expected.rows()[0]["x_mm"] == expected.actual[0, 0]


@pytest.mark.parametrize("poses", [[[0, 0, -1000]], [[0, 0, -1000, 0, 0, float("nan")]], np.zeros((2, 2, 6))])
def test_numbers_that_are_no_poses_are_refused(poses):
    model = shipped_folder("fixtures") / "models" / "small.yaml"
    with pytest.raises(ValueError, match="rows of six finite numbers"):
        dbb.predict(model, poses)


def test_a_compensated_program_is_text_or_a_file(tmp_path):
    model = shipped_folder("fixtures") / "models" / "small.yaml"
    part = tmp_path / "part.ngc"
    part.write_text("%\nG21 G90 G94\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X20 Y5 Z-1000 A0 B0 C0 F500\nM2\n%\n")
    text = dbb.compensate(part, str(model)).programs[0].text
    done = dbb.compensate(part, model, tmp_path / "out.ngc")
    assert (tmp_path / "out.ngc").read_text(encoding="utf-8") == text == done.programs[0].text
    assert done.programs[0].greatest_correction_um > 0.0


def test_circles_as_a_table():
    found = dbb.circles(SMALL, tests=["a"])
    rows = found.rows()
    assert {row["test"] for row in rows} == {"a"}
    assert rows[0]["g_um"] == found.to_dict()["runs"][0]["g_um"]
    assert "g_um" in found._repr_html_()


def test_a_frame_needs_pandas_and_says_so():
    found = dbb.circles(SMALL, tests=["a"])
    try:
        import pandas  # noqa: F401, ICN001, PLC0415
    except ImportError:
        with pytest.raises(dbb.StationError, match="pandas is not installed"):
            found.to_frame()
    else:
        assert len(found.to_frame()) == len(found.rows())


def test_causes_say_their_parameters_on_a_machine():
    machine = shipped_folder("fixtures") / "machines" / "every-key.yaml"
    (gravity,) = [one for one in dbb.known_sources(machine=machine) if one.name == "gravity"]
    assert [parameter.unit for parameter in gravity.parameters] == ["µm/kN"]
