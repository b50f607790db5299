"""What the steps after a session found, in lines made from the JSON that their commands print."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from dbbstation.files.places import shipped_folder
from dbbstation.service.work import SessionTask
from dbbstation.tui.results_screen import result_lines
from tests.cli.conftest import call

if TYPE_CHECKING:
    from pathlib import Path

SMALL = shipped_folder("fixtures") / "sessions" / "small"


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    model: Path = tmp_path_factory.mktemp("model") / "model.yaml"
    done = call("calibrate", SMALL, "--out", model, "--json")
    assert done.code == 0, done.err
    return dict(json.loads(done.out))


def test_a_calibration_says_what_it_left_and_what_the_plan_could_not_see(calibrated: dict[str, object]) -> None:
    lines = result_lines(SessionTask.CALIBRATE, calibrated | {"directions_lost": [], "gaps": [], "outliers": []})
    assert not any("not visible" in line for line in lines)
    assert f"{calibrated['residual_within_mounting_rms_um']:.2f} µm rms" in lines[3]
    assert lines[0].startswith("Use this model: ")
    blind = calibrated | {"directions_lost": ["the height of the base"], "gaps": ["no tilt beyond 20 degrees"]}
    lines = result_lines(SessionTask.CALIBRATE, blind)
    assert "not visible to these tests, held at nominal: the height of the base" in lines
    assert "  no tilt beyond 20 degrees" in lines


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("enough", [False, True])
def test_missing_physics_and_too_few_tests_are_said_where_they_are(
    calibrated: dict[str, object], *, missing: bool, enough: bool
) -> None:
    answer = calibrated | {
        "misfit": {"missing_physics": missing, "rms_um": 3.2, "probability": 1e-9},
        "plan_check": {"enough": enough, "tests": 3, "left": 2, "of_one_test": 7},
    }
    said = "\n".join(result_lines(SessionTask.CALIBRATE, answer))
    assert ("by 3.20 µm rms (probability by chance 1e-09): physics is missing" in said) is missing
    assert ("3 tests are too few" in said) is not enough


def test_a_diagnosis_lists_causes_by_what_is_known_of_them() -> None:
    answer = {
        "said": ["Measured circles and the kinematic model differ.", "The difference follows strut-force."],
        "mismatch": True,
        "misfit_rms_um": 9.3,
        "probability": 1e-120,
        "sources": [
            {"name": "gravity", "verdict": "identified", "gain": 40.0},
            {"name": "backlash", "verdict": "ambiguous", "gain": 2.0},
        ],
        "unexplained": {"text": "Nothing is left beyond noise."},
        "limits": [],
        "second_start_agrees": True,
        "next_test": None,
        "levels": {"follows": []},
    }
    lines = result_lines(SessionTask.DIAGNOSE, answer)
    assert lines[:2] == answer["said"]
    assert "by 9.30 µm rms beyond noise (probability by chance below 1e-99)" in lines[2]
    assert "Identified causes: gravity" in lines
    assert "Ambiguous: backlash" in lines
    assert lines[-2] == "Nothing is left beyond noise."
    assert lines[-1].startswith("measure next: no proposal")
    proposed = {"text": "a circle", "source": "backlash", "sigma_before": 4.0, "sigma_after": 1.0, "unit": "µm"}
    found = {"mismatch": False, "probability": 0.4, "next_test": proposed, "further_tests": []}
    more = result_lines(SessionTask.DIAGNOSE, answer | found)
    assert more[2] == "The kinematic model explains these circles (probability 0.4)."
    assert more[-1] == "measure next: a circle; this test would bring u of backlash to 1 instead of 4 µm"
    followed = {"variables": [["strut-force"]], "where": "strut 2", "before": 4.0, "after": 1.0}
    in_time = {"variables": [["time"]], "before": None, "after": None}  # it happened: no held-out test
    lines = result_lines(SessionTask.DIAGNOSE, answer | {"levels": {"follows": [followed, in_time]}})
    assert lines[2:4] == [
        f"{'█' * 24} 4 µm before: strut-force, strut 2",
        f"{'█' * 6:24} 1 µm after: strut-force, strut 2",
    ]
    assert "by 9.30 µm rms beyond noise" in lines[4]


def test_the_greatest_correction_of_all_programs_is_told() -> None:
    programs = [{"greatest_correction_um": value} for value in (62.1, None, 207.5)]
    lines = result_lines(SessionTask.PROGRAMS, {"programs": programs, "dialect": "linuxcnc"})
    assert lines == [
        "3 programs for linuxcnc, all within the machine's travel.",
        "The greatest correction is 207.5 µm.",
    ]
    nominal = [{"greatest_correction_um": None}]
    assert len(result_lines(SessionTask.PROGRAMS, {"programs": nominal, "dialect": "linuxcnc"})) == 1
