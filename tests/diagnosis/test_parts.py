"""Forms of a cause: which amplitudes each has, and what they weigh."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from dbbstation.diagnosis.parts import ALIKE, amplitudes, forms_of
from dbbstation.sources.causes.backlash import Backlash
from dbbstation.sources.causes.ball_form import BallForm


@pytest.mark.parametrize("sets", [1, 2])
def test_a_figure_has_forms_of_one_and_two_orders(reference, sets):
    forms = {label: (places, weight) for places, weight, label in forms_of(amplitudes(BallForm(), reference), sets)}
    assert Counter(len(places) // (2 * sets) for places, _ in forms.values()) == {4: 1, 1: 4, 2: 6}
    expected = np.array([0, 1, 4, 5])
    assert forms["2 lobes and 4 lobes"][0] == tuple(np.concatenate([expected, expected + 8])[: 4 * sets])
    # Three kinds weigh the same: all, one of four, one of six pairs.
    assert {round(np.exp(weight), 9) for _, weight in forms.values()} == {
        round(1 / (3 * count), 9) for count in (1, 4, 6)
    }
    assert sum(np.exp(weight) for _, weight in forms.values()) == pytest.approx(1.0)


def test_struts_act_each_alone_or_all_alike(reference):
    forms = forms_of(amplitudes(Backlash(), reference), 1)
    assert sorted(len(places) for places, _, _ in forms) == [1] * 7 + [6]
    assert [places for places, _, label in forms if label == ALIKE] == [(6,)]
    assert sum(np.exp(weight) for _, weight, _ in forms) == pytest.approx(1.0)
