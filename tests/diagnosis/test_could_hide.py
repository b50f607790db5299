"""What is not named may be there all the same: its uncertainty says how much of it could hide."""

from __future__ import annotations

import pytest

from dbbstation.diagnosis.diagnose import diagnose
from dbbstation.inference.levels import Verdict
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.screw import ScrewLead
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("few_parts")

KINEMATICS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)


def diagnosed(folder, names, *mechanisms):
    record(folder, seed=72, mechanisms=[KINEMATICS, *mechanisms], rate_hz=2.0)
    recorded = load_sessions([folder])
    return diagnose(recorded.machine, recorded.observations, sources_named(names))


def test_a_lead_error_that_the_joints_conceal_lies_within_its_uncertainty(tmp_path):
    lead_um_m = -4.7
    found = diagnosed(tmp_path / "s", ["screw-lead", "backlash"], ScrewLead((lead_um_m,) * 6))
    lead = next(f for f in found.sources if f.name == "screw-lead")
    assert lead.verdict is not Verdict.IDENTIFIED
    for value in lead.parameters.values():
        assert value.value == pytest.approx(lead_um_m, abs=4.0 * value.uncertainty)


def test_no_candidate_is_no_fault(tmp_path):
    found = diagnosed(tmp_path / "s", [])
    assert found.sources == ()
    assert not found.mismatch
