"""What the ball's place adds to the uncertainty of a circle's centre and form: of X and Y the larger, Z by itself."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.sources.contract import Setup
from dbbstation.tasks import circles as circled


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
