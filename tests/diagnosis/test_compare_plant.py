"""Two sessions of the independent plant: what was changed in the second one is what `compare` names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import binom

from dbbstation.diagnosis.compare.comparison import compare
from dbbstation.diagnosis.diagnose import usable_sources
from dbbstation.inference.levels import Verdict
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.diagnosed import default_candidates
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.noise import Noise
from tests.plant.plan import table_ii_plan
from tests.plant.session import record

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.diagnosis.compare.comparison import Comparison

GAP_UM = 4.0
COMPLIANCE_MM_N = 9.68e-6


def compared(one: Path, other: Path) -> Comparison:
    a, b = (load_sessions([folder], [], lambda *_: None, ()) for folder in (one, other))
    candidates = sources_named(default_candidates(known_sources()))
    usable, lacking = usable_sources(a.machine, [*a.observations, *b.observations], candidates)
    return compare(a.machine, a.observations, b.observations, usable, lacking)


@pytest.mark.nightly
def test_a_machine_that_did_not_change_is_not_said_to(tmp_path):
    rng = np.random.default_rng(3)
    geometry = Kinematics(length_mm=rng.normal(0, 0.05, 6), base_mm=rng.normal(0, 0.1, (6, 3)))
    alarms = []
    for seed in range(200, 240):
        coloured = Noise(white_um=0.3, correlated_um=0.24, correlation=0.6) if seed % 2 else None
        folders = [tmp_path / f"{seed}{name}" for name in "ab"]
        for folder, own, noise in zip(folders, (2 * seed, 2 * seed + 1), (None, coloured), strict=True):
            record(folder, seed=own, plan=table_ii_plan(1), mechanisms=[geometry], rate_hz=25.0, noise=noise)
        alarms.append(compared(*folders).differ)
    # Of what is said with a probability of 0.95, one in twenty may be wrong.
    assert sum(alarms) <= binom.isf(1e-3, len(alarms), 0.05)


@pytest.mark.nightly  # one change at a time is in CI: test_compare.py, and by the command docs/validation.md
def test_new_play_and_weight_are_both_named(tmp_path):
    rng = np.random.default_rng(3)
    geometry = Kinematics(length_mm=rng.normal(0, 0.05, 6), base_mm=rng.normal(0, 0.1, (6, 3)))
    changes = [Gravity(COMPLIANCE_MM_N), Backlash((GAP_UM,) * 6)]
    for name, seed, more in (("a", 2, []), ("b", 3, changes)):
        record(tmp_path / name, seed=seed, plan=table_ii_plan(1), mechanisms=[geometry, *more], rate_hz=25.0)
    found = compared(tmp_path / "a", tmp_path / "b")
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
