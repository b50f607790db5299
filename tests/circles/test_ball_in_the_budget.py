"""What the ball's place adds to the uncertainty of a circle's centre and form: of X and Y the larger, Z by itself."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.circles.budget import NOT_STATED, Budget, BudgetTerm, SetUpKnowledge, _with_form
from dbbstation.circles.estimates import BudgetQuantity
from dbbstation.sources.contract import Setup
from dbbstation.tasks import circle_runs as circled


def known(*mounting_um, place_known=True):
    """What a session states whose holder repeats so well along X, Y and Z, and whose CMM is good to 4 µm."""
    setup = Setup("s", "m", "b", "bar", np.zeros(3), 1e-3 * np.array(mounting_um), 4e-3, 1e-3, place_known=place_known)
    session = SimpleNamespace(bar=None, setup=lambda _run: setup, bar_temp_c=lambda _measured: None)
    return circled._known(session, None, SimpleNamespace(temperature_degc={}))


@pytest.mark.parametrize("mounting_um", [(3.0, 1.0, 2.0), (1.0, 3.0, 2.0)])
def test_the_worse_of_x_and_y_counts_whichever_it_is(mounting_um):
    """Square roots of 3² + 4² and 2² + 4²."""
    assert known(*mounting_um).u_ball_um == pytest.approx(5.0)
    assert known(*mounting_um).u_ball_z_um == pytest.approx(np.sqrt(20.0))


def test_a_holder_that_is_bad_in_z_alone_does_not_count_in_the_plane():
    assert known(3.0, 3.0, 30.0).u_ball_um == pytest.approx(5.0)


def test_a_ball_under_the_spindle_has_no_place():
    assert known(3.0, 1.0, 2.0, place_known=False).u_ball_um is None


def test_the_form_of_both_balls_is_part_of_u_where_both_are_stated():
    bar = SimpleNamespace(ball_form_um=0.3)
    ball = SimpleNamespace(form_um=0.4)
    # A rectangular distribution of half-width a has a / sqrt(3) [GUM 4.3.7]; both balls add as variances.
    assert circled._form_um(bar, ball) == pytest.approx(0.5 / np.sqrt(3.0))
    assert circled._form_um(bar, SimpleNamespace(form_um=None)) is None
    before = Budget(0.4, {BudgetTerm.NOISE: 0.4}, NOT_STATED, "", 20.0, 21.0, BudgetQuantity.G)
    after = _with_form(before, SetUpKnowledge(u_form_um=0.3))
    assert after.u_um == pytest.approx(0.5)
    assert BudgetTerm.FORM.value not in after.missing
    assert _with_form(replace(before, quantity=BudgetQuantity.H), SetUpKnowledge(u_form_um=0.3)).u_um == 0.4
    assert _with_form(before, SetUpKnowledge()) is before
