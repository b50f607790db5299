"""What is rather not there than there stays out of the joint model, though the most probable set of causes has it."""

from __future__ import annotations

import pytest

from dbbstation.diagnosis.diagnose import doubtful, thinned, without_doubtful
from dbbstation.diagnosis.explain import explain
from dbbstation.diagnosis.verdicts import CircleJudge, circle_levels, outcome_of
from dbbstation.inference.alternatives import EVEN
from dbbstation.inference.levels import Verdict
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.thermal import ThermalFrame
from tests.plant.mechanisms.warming import Warming
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("few_parts")

NAMES = ("gravity", "thermal-frame", "thermal-struts", "bar-drift")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tests", "rise_k"), [(EIGHT, 0.0315), pytest.param("abcdefghijklmno", 0.0133, marks=pytest.mark.nightly)]
)
def test_a_drift_of_nobody_knows_what_is_named_by_nobody_and_not_modelled(tmp_path, tests, rise_k):
    """A frame that warms by hundredths of a kelvin: three causes share the probability, and none of them has half of it."""
    kinematics = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)
    faint = ThermalFrame(Warming(rise_k, time_constant_s=600.0))
    record(
        tmp_path / "s",
        seed=200,
        plan=subset(table_ii_plan(200), tests),
        mechanisms=[kinematics, Gravity(), faint],
        rate_hz=10.0,
    )
    recorded = load_sessions([tmp_path / "s"])
    sources = sources_named(NAMES)
    explained = explain(recorded.machine, [thinned(one) for one in recorded.observations], sources, lambda _: None)
    # Which of the three stands in the most probable set is chance.
    (doubted,) = doubtful(explained)
    assert doubted in NAMES[1:]
    explained = without_doubtful(explained)
    outcome = outcome_of(explained)
    findings = CircleJudge(explained, outcome, None, circle_levels(explained, outcome, None)).findings()
    modelled = {term.source.name for term in explained.settled.after.layout.terms} & set(NAMES)
    assert modelled == {"gravity"}
    found = {finding.name: finding for finding in findings}
    drifts = [found[name] for name in NAMES[1:]]
    assert all(drift.verdict is Verdict.NOT_TESTABLE and drift.probability < EVEN for drift in drifts)
    # What was given up is still said: together they are rather there than not.
    assert sum(drift.probability for drift in drifts) > EVEN
