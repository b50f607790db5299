"""Forms of curves, against what their definition says."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.inference.forms import Walk


def test_a_walk_has_the_covariance_of_a_random_walk():
    """At its own points: the lesser of both times, in its unit [Wiener process]."""
    at = np.array([0.0, 3.0, 4.0, 10.0])
    columns = Walk(at, 2.0).columns(at)
    assert columns @ columns.T == pytest.approx(np.minimum.outer(at, at) / 2.0)
