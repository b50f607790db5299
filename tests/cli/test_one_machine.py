"""Sessions that are fitted together are of one machine, in everything that its file holds."""

from __future__ import annotations

import shutil

import pytest

from dbbstation.cli import DONE, FAILED

AXES = "[[1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0]]"
TURNED = AXES.replace("1, 0, 0", "0, 1, 0", 1)
WEIGHTS = "{strut_kg: 25, motor_kg: 20, motor_length_mm: 300}"


@pytest.fixture
def two(spoilt, tmp_path):
    """A session, and its circles 0.5 µm longer as those of a second day: nothing else but what a test changes differs."""
    spoilt.replace("session.yaml", "format: dbb-session/1\n", "format: dbb-session/1\noperator: first\n")
    other = tmp_path / "second"
    shutil.copytree(spoilt.folder, other)
    again = type(spoilt)(other)
    for path in sorted(other.glob("runs/*.csv")):
        again.column(f"runs/{path.name}", 1, lambda length_mm: length_mm + 0.0005)
    text = (other / "session.yaml").read_text()
    (other / "session.yaml").write_text(text.replace("operator: first", "operator: second"))
    return spoilt.folder, other


def add(folder, text):
    path = folder / "machine.yaml"
    path.write_text(path.read_text() + text + "\n")


def change(folder, old, new):
    path = folder / "machine.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def refused(run, two):
    outcome = run("calibrate", *two)
    assert outcome.code == FAILED
    assert outcome.out == ""
    for part in (str(two[0]), str(two[1]), "session", "machine.yaml"):
        assert part in outcome.err
    return outcome.err


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("platform_kg: 400.0", "platform_kg: 450.0", "masses.platform_kg 400.0 and 450.0"),
        ("screw_lead_mm: 10.0", "screw_lead_mm: 5.0", "screw_lead_mm 10.0 and 5.0"),
        ("xy_radius_mm: 300", "xy_radius_mm: 310", "travel.xy_radius_mm 300.0 and 310.0"),
        ("strut_mm: [300, 1380]", "strut_mm: [300, 1390]", "travel.strut_mm [300.0, 1380.0] and [300.0, 1390.0]"),
        (
            "rotation: Rx(A) Ry(B) Rz(C)",
            "rotation: Rz(C) Ry(B) Rx(A)",
            "rotation Rx(A) Ry(B) Rz(C) and Rz(C) Ry(B) Rx(A)",
        ),
        (
            "reference_length_error_mm: [0.0, 0.0,",
            "reference_length_error_mm: [0.0, 0.01,",
            "reference_length_error_mm of strut 2 0.0 and 0.01",
        ),
    ],
)
def test_a_value_that_differs_is_named_with_both_values(run, two, old, new, said):
    change(two[1], old, new)
    assert said in refused(run, two)


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        (
            "compliance: {at_1000mm_mm_per_n: 9.68e-6}",
            "compliance: {at_1000mm_mm_per_n: 1.2e-5}",
            "compliance.at_1000mm_mm_per_n 9.68e-06 and 1.2e-05",
        ),
        (
            "compliance: {at_1000mm_mm_per_n: 9.68e-6}",
            "compliance: {at_1000mm_mm_per_n: 9.68e-6, growing_share: 0.5}",
            "compliance.growing_share 0.9 and 0.5",
        ),
        ("joint_tolerance_mm: 0.1", "joint_tolerance_mm: 0.2", "joint_tolerance_mm 0.1 and 0.2"),
        ("joint_tolerance_mm: 0.1", "", "joint_tolerance_mm 0.1 and not given"),
        (
            f"strut_masses: {WEIGHTS}",
            f"strut_masses: {WEIGHTS.replace('motor_kg: 20', 'motor_kg: 30')}",
            "strut_masses.motor_kg 20.0 and 30.0",
        ),
        (
            f"joint_axes: {{base: {AXES}, platform: {AXES}}}",
            f"joint_axes: {{base: {AXES}, platform: {TURNED}}}",
            "joint_axes.platform of strut 1 [1.0, 0.0, 0.0] and [0.0, 1.0, 0.0]",
        ),
    ],
)
def test_an_optional_value_that_differs_is_named_too(run, two, first, second, said):
    add(two[0], first)
    add(two[1], second)
    assert said in refused(run, two)


def test_everything_that_differs_is_in_one_message(run, two):
    change(two[1], "platform_kg: 400.0", "platform_kg: 450.0")
    change(two[1], "screw_lead_mm: 10.0", "screw_lead_mm: 5.0")
    told = refused(run, two)
    assert "masses.platform_kg 400.0 and 450.0" in told
    assert "screw_lead_mm 10.0 and 5.0" in told


def test_another_name_alone_is_told_and_taken(run, two):
    change(two[1], "name: PM-600-like reference", "name: Hexapod 7")
    outcome = run("calibrate", *two, "--json")
    assert outcome.code == DONE, outcome.err
    assert "Hexapod 7" in outcome.err
    assert "PM-600-like reference" in outcome.err
