"""Dates that cannot be right."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from dbbstation.history.order import date_faults
from dbbstation.history.record import SessionFigures

NOW = datetime(2026, 11, 23, tzinfo=UTC)


def sessions(*weeks, names=None):
    names = names or [f"w{k + 1}" for k in range(len(weeks))]
    return [
        SessionFigures(name, name, "m", datetime(2026, 1, 1, tzinfo=UTC) + timedelta(weeks=week), ())
        for name, week in zip(names, weeks, strict=True)
    ]


def test_dates_in_the_order_of_names_are_right():
    assert date_faults(sessions(*range(12)), NOW) == []


@pytest.mark.parametrize("wrong", [-3, 5])
def test_one_session_out_of_order_is_named(wrong):
    weeks = [*range(8), wrong, *range(9, 16)]
    (said,) = date_faults(sessions(*weeks), NOW) if wrong != 5 else date_faults(sessions(*weeks), NOW)[-1:]
    assert said.startswith("w9 is dated")
    assert "follows w8" in said
    assert said.endswith("was the clock set wrong?")


def test_names_that_say_nothing_of_the_order_are_no_witness():
    assert date_faults(sessions(5, 1, 7, 0, 6, 3, 2, 4), NOW) == []


def test_a_date_that_is_still_to_come_is_told():
    (said,) = date_faults(sessions(0, 1, 60), NOW)
    assert said == "w3 is dated 2027-02-25 00:00, which is still to come: was the clock set wrong?"


def test_equal_dates_are_told():
    (said,) = date_faults(sessions(0, 1, 1, 2), NOW)
    assert said.startswith("w2 and w3 both start at 2026-01-08 00:00")
