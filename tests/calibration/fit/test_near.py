"""How far a fit may move shapes that it starts from."""

from __future__ import annotations

import numpy as np

from dbbstation.calibration.fit.calibrate import _near
from dbbstation.calibration.layout import Layout, ParameterSet
from dbbstation.inference.square_root import Columns
from dbbstation.sources.registry import sources_named


def near(reference, name, values):
    source = sources_named([name])[0]
    terms = (ParameterSet(source, "", source.parameters(reference), slice(0, len(values))),)
    known = Columns(np.full(len(values), np.inf), np.ones(len(values)), np.zeros(len(values), dtype=bool))
    layout = Layout(reference, terms, known, np.zeros(len(values)))
    return _near(layout, {name: np.array(values)}, 0.5, np.inf).known.prior, source.parameters(reference)


def test_a_listed_period_is_known_to_a_thousandth(reference):
    prior, _ = near(reference, "bar-cyclic", [0.0, 0.0, 20.0])
    np.testing.assert_allclose(prior, [np.inf, np.inf, 0.02])


def test_a_shape_of_no_size_may_move_by_a_share_of_a_tenth_of_what_is_plausible(reference):
    source = sources_named(["bar-drift"])[0]
    of = source.parameters(reference)
    prior, _ = near(reference, "bar-drift", [0.0] * len(of))
    shapes = [k for k, one in enumerate(of) if one.grid]
    assert shapes
    np.testing.assert_allclose(prior[shapes], [0.05 * of[k].plausible for k in shapes])
