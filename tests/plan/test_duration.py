"""Time that circles take at their planned feeds, against lengths of their paths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.plan.plan import circle_s, circles_s


def test_a_circle_takes_its_path_over_its_feed():
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    circle = plan.tests["a"].circle
    # 450 degrees of 150 mm and 1.5 mm in and out, at 1000 mm/min.
    path_mm = np.radians(450.0) * 150.0 + 2 * 1.5
    assert circle_s(circle) == pytest.approx(60.0 * path_mm / 1000.0)
    assert circle_s(replace(circle, feed_mm_min=2000.0)) == pytest.approx(circle_s(circle) / 2.0)
    assert circles_s([circle] * 3) == pytest.approx(3.0 * circle_s(circle))
