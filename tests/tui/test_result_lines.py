"""What the steps after a session found, in lines made from the JSON that their commands print."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from dbbstation.files.shipped import shipped_folder
from dbbstation.service.job import SessionTask
from dbbstation.tui import texts
from dbbstation.tui.result_lines import result_lines
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
    assert lines.count(texts.ALL_SEEN) == 1
    assert f"{calibrated['residual_within_mounting_rms_um']:.1f}" in lines[0]
    blind = calibrated | {"directions_lost": ["the height of the base"], "gaps": ["no tilt beyond 20 degrees"]}
    lines = result_lines(SessionTask.CALIBRATE, blind)
    assert texts.ALL_SEEN not in lines
    assert texts.UNSEEN.format(text="the height of the base") in lines
    assert texts.GAP.format(text="no tilt beyond 20 degrees") in lines


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("enough", [False, True])
def test_missing_physics_and_too_few_tests_are_said_where_they_are(
    calibrated: dict[str, object], *, missing: bool, enough: bool
) -> None:
    answer = calibrated | {
        "misfit": {"missing_physics": missing, "rms_um": 3.2},
        "plan_check": {"enough": enough, "tests": 3, "left": 2},
    }
    lines = result_lines(SessionTask.CALIBRATE, answer)
    assert (texts.PHYSICS_MISSING.format(rms=3.2) in lines) is missing
    assert (texts.TOO_FEW.format(tests=3, left=2) in lines) is not enough


def test_a_diagnosis_lists_causes_by_what_is_known_of_them() -> None:
    answer = {
        "mismatch": True,
        "misfit_rms_um": 9.3,
        "noise_um": 0.3,
        "sources": [{"name": "gravity", "verdict": "identified"}, {"name": "backlash", "verdict": "ambiguous"}],
        "unexplained": {"text": "Nothing is left beyond noise."},
        "next_test": None,
    }
    lines = result_lines(SessionTask.DIAGNOSE, answer)
    assert lines[0] == texts.MISMATCH.format(rms=9.3, noise=0.3)
    assert texts.CAUSES.format(verdict=texts.VERDICT_WORDS["identified"], names="gravity") in lines
    assert texts.CAUSES.format(verdict=texts.VERDICT_WORDS["ambiguous"], names="backlash") in lines
    assert lines[-1] == "Nothing is left beyond noise."
    more = result_lines(SessionTask.DIAGNOSE, answer | {"mismatch": False, "next_test": {"text": "a circle"}})
    assert more[0] == texts.NO_MISMATCH.format(rms=9.3, noise=0.3)
    assert more[-1] == texts.MEASURE_NEXT.format(text="a circle")
    said = ["Measured circles and the kinematic model differ.", "The difference follows strut-force."]
    assert result_lines(SessionTask.DIAGNOSE, answer | {"said": said})[:2] == said


def test_the_greatest_correction_of_all_programs_is_told() -> None:
    programs = [{"greatest_correction_um": value} for value in (62.1, None, 207.5)]
    lines = result_lines(SessionTask.PROGRAMS, {"programs": programs, "dialect": "linuxcnc"})
    assert lines == [texts.PROGRAMMED.format(count=3, dialect="linuxcnc"), texts.CORRECTED.format(most=207.5)]
    nominal = [{"greatest_correction_um": None}]
    assert len(result_lines(SessionTask.PROGRAMS, {"programs": nominal, "dialect": "linuxcnc"})) == 1
