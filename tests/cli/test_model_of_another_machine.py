"""A model tells nothing of another machine's recordings: `evaluate` refuses it as `program` does."""

from __future__ import annotations

import pytest

from dbbstation.cli import DONE, FAILED


@pytest.fixture
def small(run, spoilt, tmp_path):
    path = tmp_path / "model.yaml"
    assert run("calibrate", spoilt.folder, "--out", path).code == DONE
    return path


def change_first_joint(spoilt, by_mm):
    path = spoilt.path("machine.yaml")
    line = next(line for line in path.read_text().splitlines() if line.startswith("base_joints_mm"))
    first = line.partition("[[")[2].partition(",")[0]
    spoilt.replace("machine.yaml", f"[[{first},", f"[[{float(first) + by_mm:.6f},")
    return float(first)


def test_a_joint_that_is_a_millimetre_off(run, spoilt, small):
    x_mm = change_first_joint(spoilt, 1.0)
    outcome = run("evaluate", spoilt.folder, "--model", small)
    assert outcome.code == FAILED
    assert outcome.out == ""
    assert "another nominal machine" in outcome.err
    assert "base_joints_mm of strut 1" in outcome.err
    assert f"{x_mm}" in outcome.err
    assert f"{x_mm + 1.0:.6f}".rstrip("0") in outcome.err


def test_other_masses(run, spoilt, small):
    spoilt.replace("machine.yaml", "platform_kg: 400.0", "platform_kg: 450.0")
    outcome = run("evaluate", spoilt.folder, "--model", small)
    assert outcome.code == FAILED
    assert "masses.platform_kg 400.0 and 450.0" in outcome.err


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("xy_radius_mm: 300", "xy_radius_mm: 310"),
        ("name: PM-600-like reference", "name: Hexapod 7"),
        ("screw_lead_mm: 10.0", "screw_lead_mm: 10.0\njoint_tolerance_mm: 0.1"),
        ("screw_lead_mm: 10.0", "screw_lead_mm: 10.0\ncompliance: {at_1000mm_mm_per_n: 1.0e-5}"),
    ],
)
def test_what_no_prediction_uses_may_differ(run, spoilt, small, old, new):
    spoilt.replace("machine.yaml", old, new)
    outcome = run("evaluate", spoilt.folder, "--model", small)
    assert outcome.code == DONE, outcome.err
