"""Errors that come from another process."""

from __future__ import annotations

import pickle

import pytest

from dbbstation.errors import CalibrationError, InputError, Problem


@pytest.mark.parametrize(
    "error",
    [
        CalibrationError("the fit still moves", where="here", remedy="leave out doubtful tests"),
        InputError([Problem("a.csv", 3, 0, "is cut off", "record it again")]),
    ],
)
def test_an_error_comes_whole_from_another_process(error):
    again = pickle.loads(pickle.dumps(error))  # noqa: S301 - made here
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))
