"""Balls and bars far off their stated sizes, beside physics and alone, in sessions of the independent plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.outliers.outlier import OutlierKind
from dbbstation.diagnosis.diagnose import diagnose
from dbbstation.facts.serialise import plain
from dbbstation.inference.levels import Verdict
from dbbstation.results.diagnosis import diagnosis_figures
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.balls import BadSeating
from tests.plant.mechanisms.bar import BarOffset
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.thermal import JigThermal
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("few_parts")

NAMES = ("gravity", "screw-lead", "jig-thermal", "tool-ball-offset", "platform-joints", "backlash")


def diagnosed(folder, seed, *mechanisms, tests="abcdefghijklmno", rate_hz=5.0):
    record(
        folder,
        seed=seed,
        plan=replace(subset(table_ii_plan(seed), tests), repeat_at_end=("a", "f", "k")),
        mechanisms=[RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05), *mechanisms],
        rate_hz=rate_hz,
    )
    recorded = load_sessions([folder])
    return diagnose(recorded.machine, recorded.observations, sources_named(NAMES))


def named(diagnosis):
    return {finding.name for finding in diagnosis.sources if finding.verdict is not Verdict.RULED_OUT} - {
        finding.name for finding in diagnosis.sources if finding.verdict is Verdict.NOT_TESTABLE
    }


@pytest.mark.nightly  # a badly seated ball is in CI, and a bar that is another one between two sessions: test_compare.py
@pytest.mark.parametrize("offset_um", [6.0, -9.0])
def test_a_bar_that_was_set_wrongly_is_no_warm_plate(tmp_path, offset_um):
    diagnosis = diagnosed(tmp_path / "s", 41, BarOffset(offset_um))
    assert [outlier.kind for outlier in diagnosis.outliers] == [OutlierKind.BAR]
    assert named(diagnosis) == set()
    assert diagnosis.mismatch
    (found,) = diagnosis.outliers
    # The plant's own bars are off by 0.5 um at random besides.
    assert found.size_um == pytest.approx(offset_um, abs=3 * np.hypot(found.uncertainty_um, 0.5))
    assert 0 < found.uncertainty_um < 2.0
    told = next(
        source for source in plain(diagnosis_figures(diagnosis, {}))["sources"] if source["name"] == "bar-offset"
    )
    assert told["verdict"] == "happened"
    (value,) = told["parameters"].values()
    assert value["value"] == found.size_um


@pytest.mark.nightly  # a badly seated ball is in CI
def test_a_warm_plate_is_no_ball_off_the_tool_tip(tmp_path):
    diagnosis = diagnosed(tmp_path / "s", 43, JigThermal(rise_k=2.7))
    assert named(diagnosis) >= {"jig-thermal"}
    wrong = [f for f in diagnosis.sources if f.verdict is Verdict.IDENTIFIED and f.name != "jig-thermal"]
    assert not [f.name for f in wrong if "jig-thermal" not in f.equivalent]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tests", "rate_hz", "within"),
    [(EIGHT, 3.0, 0.09), pytest.param("abcdefghijklmno", 5.0, 0.015, marks=pytest.mark.nightly)],
)
def test_a_badly_seated_ball_beside_gravity_is_found_with_it(tmp_path, tests, rate_hz, within):
    """Eight tests know the compliance to 3 %, one standard deviation."""
    seat = BadSeating({3: np.array([20.0, -25.0, 0.0])})
    diagnosis = diagnosed(tmp_path / "s", 42, Gravity(), seat, tests=tests, rate_hz=rate_hz)
    assert named(diagnosis) == {"gravity"}
    (found,) = diagnosis.outliers
    assert found.kind is OutlierKind.MOUNTING
    # The holder scatters by a micrometre per axis besides; where exactly it stands is partly the joints' matter.
    assert found.size_um == pytest.approx(np.hypot(20.0, 25.0), abs=3 * np.hypot(found.uncertainty_um, 1.0))
    assert 0 < found.uncertainty_um < 6.0
    compliance = next(f for f in diagnosis.sources if f.name == "gravity").parameters["strut_compliance_um_kn"]
    assert compliance.value == pytest.approx(9.68, rel=within)
    assert compliance.value == pytest.approx(9.68, abs=3 * compliance.uncertainty)
