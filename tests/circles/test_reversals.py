"""Steps of a path at places of the turn: none where the turn itself begins and ends."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.circles.reversals import FAR_DEG, step_at
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.recording import RawCircle

CIRCLE = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0, 45, 1.5, 0, Direction.CCW)
PHI = np.arange(0.0, 360.0, 0.125)
RAW = RawCircle("a run", CIRCLE, PHI / CIRCLE.turning_deg_s, PHI, np.full(len(PHI), 150.0))


def at(phi_deg):
    """The step at an angle of travel, of a path that drifts by 3 µm over the turn."""
    theta_deg = float(CIRCLE.theta_deg(np.array([phi_deg]))[0])
    return step_at(RAW, 3.0 * PHI / 360.0, theta_deg, 0.1)


@pytest.mark.parametrize("phi_deg", [0.0, 3.0, 6.0, FAR_DEG - 0.5, 360.0 - FAR_DEG + 0.5, 354.0, 357.0])
def test_where_the_turn_begins_and_ends_there_is_no_step(phi_deg):
    assert at(phi_deg) is None


@pytest.mark.parametrize("phi_deg", [FAR_DEG, 90.0, 180.0, 360.0 - FAR_DEG])
def test_elsewhere_a_drift_is_no_step(phi_deg):
    found = at(phi_deg)
    assert found is not None
    assert found.height_um == pytest.approx(0.0, abs=1e-9)
