"""Faint effects of one strut, or of all alike, in sessions of the independent plant: named by their few amplitudes."""

from __future__ import annotations

import pytest

from dbbstation.diagnosis.diagnose import diagnose
from dbbstation.inference.levels import Verdict
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.servo import ServoLag
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("few_parts")

FEW = ("servo-lag", "backlash", "joint-friction")
"""What follows the speed of a strut, and reversals."""
NAMES = (*FEW, "joint-runout", "platform-joints", "screw-lead")


def diagnosed(folder, seed, mechanism, rate_hz=20.0, tests="abcdefghijklmno", names=NAMES):
    record(
        folder,
        seed=seed,
        plan=subset(table_ii_plan(seed), tests),
        mechanisms=[RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05), mechanism],
        rate_hz=rate_hz,
    )
    recorded = load_sessions([folder])
    return diagnose(recorded.machine, recorded.observations, sources_named(names))


def identified(diagnosis):
    return {f.name: f for f in diagnosis.sources if f.verdict is Verdict.IDENTIFIED}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate_hz", "tests", "names"),
    [(10.0, EIGHT, FEW), pytest.param(20.0, "abcdefghijklmno", NAMES, marks=pytest.mark.nightly)],
)
def test_one_strut_that_is_late_is_named_though_circles_see_no_common_lag(tmp_path, rate_hz, tests, names):
    late_ms = 0.015
    found = identified(
        diagnosed(tmp_path / "s", 51, ServoLag((0.0, 0.0, 0.0, late_ms, 0.0, 0.0)), rate_hz, tests, names)
    )
    assert set(found) == {"servo-lag"}
    values = [found["servo-lag"].parameters[f"strut_{k}_ms"].value for k in range(1, 7)]
    others = sum(values[:3] + values[4:]) / 5
    assert values[3] - others == pytest.approx(late_ms, abs=0.004)


@pytest.mark.nightly  # a strut that is late is in CI
def test_a_backlash_of_one_strut_is_no_effect_without_a_name(tmp_path):
    found = identified(diagnosed(tmp_path / "s", 60, Backlash((0.0, 0.0, 0.3, 0.0, 0.0, 0.0))))
    assert set(found) == {"backlash"}
    assert found["backlash"].parameters["strut_3_um"].value == pytest.approx(0.3, abs=0.1)


@pytest.mark.nightly  # a strut that is late is in CI
def test_a_backlash_that_all_struts_share_is_named_where_no_single_one_would_be(tmp_path):
    play_um = 0.15
    found = identified(diagnosed(tmp_path / "s", 52, Backlash((play_um,) * 6)))
    assert set(found) == {"backlash"}
    values = [v.value for v in found["backlash"].parameters.values()]
    sigmas = [v.uncertainty for v in found["backlash"].parameters.values()]
    assert sum(values) / 6 == pytest.approx(play_um, abs=0.05)
    assert values == pytest.approx([play_um] * 6, abs=4 * max(sigmas))
