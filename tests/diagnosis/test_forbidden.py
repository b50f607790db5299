"""Values that physics forbids: they bar their own set, with the figure, and no other."""

from __future__ import annotations

import numpy as np
import pytest

from studies.diagnosed import diagnose_sessions
from tests.plant.mechanisms.disturbances import WALK_STEP_S, WanderingBar
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.weights import BaseCompliance
from tests.plant.plan import ALL, EIGHT, subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("few_parts")

KINEMATICS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)
UM_KN = 1e-6


def _found(folder, *mechanisms, tests):
    plan = subset(table_ii_plan(48), tests)
    record(folder, seed=48, plan=plan, mechanisms=[KINEMATICS, *mechanisms], rate_hz=4.0)
    found = diagnose_sessions([folder], ("base-compliance",), (), lambda _: None).diagnosis
    (compliance,) = [source for source in found.sources if source.name == "base-compliance"]
    return found, compliance


@pytest.mark.slow
def test_a_frame_that_yields_against_its_load_is_no_compliance_and_the_figure_is_said(tmp_path):
    _, compliance = _found(tmp_path / "s", BaseCompliance((-1.5 * UM_KN, -1.5 * UM_KN, -3.0 * UM_KN)), tests=EIGHT)
    assert str(compliance.verdict) == "ruled-out"
    assert "would have to be negative, horizontal_um_kn -1." in compliance.text


@pytest.mark.slow
def test_a_compliance_keeps_name_and_values_beside_an_effect_without_a_name(tmp_path):
    """A bar that wanders by 3 µm, and nothing among the candidates that follows the time."""
    walk = np.cumsum(np.random.default_rng(7).normal(0.0, 0.03 * np.sqrt(WALK_STEP_S), 14_000))
    bar, frame = WanderingBar(walk_um=tuple(walk)), BaseCompliance((0.9 * UM_KN, 0.9 * UM_KN, 2.6 * UM_KN))
    found, compliance = _found(tmp_path / "s", bar, frame, tests=ALL)
    assert str(compliance.verdict) == "identified"
    assert "time" in (found.unexplained.variable or "")
    for name, true in (("horizontal_um_kn", 0.9), ("vertical_um_kn", 2.6)):
        value = compliance.parameters[name]
        assert abs(value.value - true) <= 3.0 * value.uncertainty
        # The joint fit, without the wander, makes the vertical one -12.
        assert abs(value.value - true) < 0.3 * true
