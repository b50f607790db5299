"""Forms of a cause: which amplitudes each has, and what they weigh."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from dbbstation.diagnosis.parts import ALIKE, amplitudes, parts_of
from dbbstation.sources.causes.backlash import Backlash
from dbbstation.sources.causes.ball_form import BallForm


@pytest.mark.parametrize("sets", [1, 2])
def test_a_figure_has_forms_of_one_and_two_orders(reference, sets):
    forms = {form.label: form for form in parts_of(amplitudes(BallForm(), reference), sets)}
    assert Counter(len(form.amplitudes) // (2 * sets) for form in forms.values()) == {4: 1, 1: 4, 2: 6}
    expected = np.array([0, 1, 4, 5])
    assert forms["2 lobes and 4 lobes"].amplitudes == tuple(np.concatenate([expected, expected + 8])[: 4 * sets])
    # Three kinds weigh the same: all, one of four, one of six pairs.
    assert {round(np.exp(form.log_weight), 9) for form in forms.values()} == {
        round(1 / (3 * count), 9) for count in (1, 4, 6)
    }
    assert sum(np.exp(form.log_weight) for form in forms.values()) == pytest.approx(1.0)


def test_struts_act_each_alone_or_all_alike(reference):
    forms = parts_of(amplitudes(Backlash(), reference), 1)
    assert sorted(len(form.amplitudes) for form in forms) == [1] * 6 + [6, 6]
    assert [form.label for form in forms if form.alike] == [ALIKE]
    assert sum(np.exp(form.log_weight) for form in forms) == pytest.approx(1.0)
