"""Two sessions of the independent plant: what was changed in the second one is what `compare` names."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosed import default_candidates
from dbbstation.diagnosis.compare.comparison import compare
from dbbstation.diagnosis.diagnose import usable_sources
from dbbstation.inference.verdict import Verdict
from dbbstation.recorded import load_sessions
from dbbstation.sources.registry import known_sources, sources_named
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.plan import table_ii_plan
from tests.plant.session import record

GAP_UM = 4.0
COMPLIANCE_MM_N = 9.68e-6


@pytest.mark.slow
def test_new_play_and_weight_are_both_named(tmp_path):
    """Struts that give way under the platform, and all with new play: two causes at once, each with its size."""
    rng = np.random.default_rng(3)
    geometry = Kinematics(length_mm=rng.normal(0, 0.05, 6), base_mm=rng.normal(0, 0.1, (6, 3)))
    changes = [Gravity(COMPLIANCE_MM_N), Backlash((GAP_UM,) * 6)]
    for name, seed, more in (("a", 2, []), ("b", 3, changes)):
        record(tmp_path / name, seed=seed, plan=table_ii_plan(1), mechanisms=[geometry, *more], rate_hz=25.0)
    a, b = (load_sessions([tmp_path / name], [], lambda *_: None, ()) for name in "ab")
    candidates = sources_named(default_candidates(known_sources()))
    usable, lacking = usable_sources(a.machine, [*a.observations, *b.observations], candidates)
    found = compare(a.machine, a.observations, b.observations, usable, lacking)
    assert found.differ
    there = {finding.name: finding for finding in found.there if finding.verdict is Verdict.IDENTIFIED}
    assert {"gravity", "backlash"} <= set(there)
    compliance = there["gravity"].values["strut_compliance_um_kn"]
    assert compliance.value == pytest.approx(1e6 * COMPLIANCE_MM_N, abs=3 * compliance.uncertainty)
    assert "strut-weight" in there["gravity"].equivalent
    play = next(iter(there["backlash"].values.values()))
    assert play.value == pytest.approx(GAP_UM, rel=0.05)
    # 1 µm rms of it changes its sign with the direction; nothing else does.
    assert found.effects["backlash"].opposite > 0.95
    assert found.effects["gravity"].opposite < 1e-3
    assert found.held_out[1].rms < 0.1 * found.held_out[0].rms
