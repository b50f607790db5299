"""A bar that nobody put on a calibrator: its length is found from the circles, and is in no stated uncertainty as if it were exact."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES, calibrate
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.bar import BarOffset
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import elevated, table_ii_plan
from tests.plant.session import record

OFF_UM = 20.0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bar") / "session"
    plan = elevated(table_ii_plan(5), 5.0, "abcde")
    truth = record(
        folder, seed=5, plan=plan, mechanisms=[RandomKinematics(0.05, 0.05)], setup=[BarOffset(OFF_UM)], rate_hz=2.0
    )
    file = folder / "session.yaml"
    text = file.read_text(encoding="utf-8")
    without = re.sub(r"^bar:.*\n( .*\n)*", "", text, flags=re.MULTILINE)
    assert without != text
    file.write_text(without, encoding="utf-8")
    return folder, truth


def test_strut_lengths_lie_within_their_u_though_the_bar_is_off(recorded):
    folder, truth = recorded
    sessions = load_sessions([folder])
    found = calibrate(sessions.machine, sessions.observations, sources_named(KINEMATIC_SOURCES + MEASUREMENT_SOURCES))
    sigma = np.sqrt(np.diag(found.solution.covariance))
    columns = {term.source.name: term.columns for term in found.layout.terms}
    struts = columns["strut-reference-length"]
    off = (found.x[struts] - truth.delta_length_mm) / sigma[struts]
    assert np.abs(off).max() < 4.0
    assert 1e3 * found.x[columns["bar-offset"]][0] == pytest.approx(OFF_UM, abs=4e3 * sigma[columns["bar-offset"]][0])
