"""When a curve without a name takes the place of names, on races of one column each that are written down by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from dbbstation.diagnosis.unexplained import _overrules, _rival
from dbbstation.diagnosis.unnamed import Best

from dbbstation.diagnosis.forms import Proportional
from dbbstation.diagnosis.shapes import EVERY, Shape
from dbbstation.inference.race import Race, Variant

COLUMN = Variant(np.array([0]), np.array([10.0]))
CURVE = Shape("strut-speed", "", 3, EVERY, Proportional(1.0))


def race(explains, leaves):
    """One column of unit length that explains the square of the first of what is there, beside the square of the second."""
    return Race(np.array([[1.0, explains], [0.0, leaves]]), 0)


def shapes(explains, leaves):
    there = race(explains, leaves)
    best = Best(CURVE, COLUMN, there.evidence([COLUMN]))
    return SimpleNamespace(race=there, shapes=((CURVE, COLUMN),), each=(best,))


def test_a_curve_that_explains_all_of_what_the_name_explains_and_more_takes_its_place():
    """Columns at 26 degrees to each other, twenty standard deviations of the curve."""
    along, across = 20.0 * 0.9, 20.0 * np.sqrt(1.0 - 0.81)
    found = _rival(race(along, across), [COLUMN], shapes(20.0, 0.0), shapes(across, 0.0))
    assert found is not None
    assert found.shape is CURVE


def test_two_causes_that_have_nothing_in_common_both_stay():
    name, of, beside = race(15.0, 14.0), shapes(14.0, 15.0), shapes(14.0, 0.0)
    assert _rival(name, [COLUMN], of, beside) is None
    assert not _overrules(name, [COLUMN], of, of.each[0])


def test_a_curve_that_only_resembles_the_name_explains_beside_it_what_chance_lets_it():
    """The same angle, and the name is the cause."""
    along, across = 20.0 * 0.9, 20.0 * np.sqrt(1.0 - 0.81)
    assert _rival(race(20.0, 0.0), [COLUMN], shapes(along, across), shapes(2.0, 0.0)) is None


def test_little_that_a_rough_law_leaves_of_a_loud_cause_is_no_other_cause():
    of, beside = shapes(90.0, 43.6), shapes(20.0, 0.0)
    assert _rival(race(100.0, 5.0), [COLUMN], of, beside) is None
