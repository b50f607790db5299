"""Whether a run shows the circle of another test, by closed form: two circles that differ in their mean reading alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.plan.plan import Circle, Direction
from dbbstation.quality.finding import FindingVerdict
from dbbstation.quality.knowledge import Planned
from dbbstation.quality.swapped import of_its_test
from dbbstation.trace.expected import COEFFICIENTS, Expected

CIRCLE = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0.0, 45, 1.5, 0, Direction.CCW)
APART_UM, KNOWN_UM = 100.0, 5.0
MEAN = np.eye(COEFFICIENTS)[0]


def expected(mean_um: float) -> Expected:
    effects = {("machine", ""): KNOWN_UM * np.eye(COEFFICIENTS)}
    return Expected(np.zeros(2), 0.0, np.eye(3), form_um=mean_um * MEAN, effects_um=effects)


@pytest.mark.parametrize(
    ("drift_um_s", "verdict"), [(0.0, FindingVerdict.WRONG), (1.0 / 60.0, FindingVerdict.CANNOT_TELL)]
)
def test_what_drifted_since_the_session_began_is_no_circle_of_another_test(drift_um_s, verdict):
    """A bar that reads 100 µm too long after 100 minutes, where another circle is expected there: wrong, unless the bar drifts by 1 µm/min."""
    started_s = 6000.0
    run = SimpleNamespace(
        test="a",
        circle=CIRCLE,
        expected=expected(0.0),
        planned=(Planned("b", CIRCLE, expected(APART_UM)),),
        started_s=started_s,
    )
    one = SimpleNamespace(run=run, coefficients_um=APART_UM * MEAN, u_um=0.0, drift_um_s=drift_um_s)
    found = of_its_test(one, None)
    assert found.verdict is verdict
    # Normal densities of one covariance: half the square of what both are apart over the variance.
    variance_um2 = KNOWN_UM**2 + (drift_um_s * started_s) ** 2
    assert found.value == pytest.approx(0.5 * APART_UM**2 / variance_um2)
