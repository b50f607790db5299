"""A faint effect beside a loud one, in sessions of the independent plant."""

from __future__ import annotations

import pytest

from dbbstation.diagnosis.diagnose import diagnose
from dbbstation.inference.levels import Verdict
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.servo import ReversalSpike
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import MEANS_OF_TWO_HZ, record

pytestmark = pytest.mark.usefixtures("few_parts")

FEW = ("gravity", "backlash", "reversal-spike", "joint-friction")
NAMES = (*FEW, "servo-lag", "screw-lead")
ALL = "abcdefghijklmno"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "tests", "rate_hz", "decay_s"),
    [
        (FEW, EIGHT, MEANS_OF_TWO_HZ, 0.15),
        *(pytest.param(NAMES, ALL, 10.0, decay_s, marks=pytest.mark.nightly) for decay_s in (0.15, 0.4)),
    ],
)
def test_short_spikes_are_found_beside_gravity_however_uncertain_their_height_is(
    tmp_path, names, tests, rate_hz, decay_s
):
    kinematics = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)
    record(
        tmp_path / "s",
        seed=61,
        plan=subset(table_ii_plan(61), tests),
        mechanisms=[kinematics, Gravity(), ReversalSpike((1.2,) * 6, decay_s)],
        rate_hz=rate_hz,
    )
    recorded = load_sessions([tmp_path / "s"])
    diagnosis = diagnose(recorded.machine, recorded.observations, sources_named(names))
    found = {f.name for f in diagnosis.sources if f.verdict is Verdict.IDENTIFIED}
    assert found == {"gravity", "reversal-spike"}
