"""When a run was taken, as other programs write it."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import pytest

from dbbstation.tasks.importing.moments import (
    UnclearMomentError,
    moment_above,
    moment_in,
    moment_in_name,
    zone_named,
)

BERLIN = timezone(timedelta(hours=1))
EIGHT = datetime(2026, 11, 20, 8, 4, tzinfo=BERLIN)


@pytest.mark.parametrize(
    "text",
    [
        "2026-11-20T08:04",
        "2026-11-20 08:04:00",
        "2026-11-20T07:04:00Z",
        "2026-11-20 08:04+01:00",
        "20.11.2026 08:04",
        "20.11.2026, 08:04:00",
        "2026/11/20 8:04",
        "20/11/2026 08:04",
        "11/20/2026 8:04 AM",
        "20 Nov 2026 08:04",
        "20. November 2026 08:04",
        "Nov 20, 2026 08:04",
        "20261120T080400",
        "20261120_0804",
    ],
)
def test_one_moment_in_every_way_of_writing(text):
    found = moment_in(text, BERLIN)
    assert found.at == EIGHT
    assert found.assumed == ()


def test_a_date_alone_says_that_the_time_of_day_is_not_known():
    found = moment_in("20.11.2026", BERLIN)
    assert found.at == datetime(2026, 11, 20, tzinfo=BERLIN)
    assert "no time of day" in found.assumed[0]


def test_without_a_zone_that_of_the_computer_is_said():
    assert "no time zone" in moment_in("2026-11-20 08:04", None).assumed[0]
    assert moment_in("2026-11-20 08:04Z", None).assumed == ()


@pytest.mark.parametrize("text", ["11/12/2026", "31.02.2026", "Thursday", "20 Foo 2026", "2026-13-01", ""])
def test_what_is_no_date_or_two_is_refused(text):
    with pytest.raises(UnclearMomentError):
        moment_in(text, UTC)


def test_lines_above_a_table():
    assert moment_above({"datum": "20.11.2026 08:04"}, BERLIN)[1].at == EIGHT
    assert moment_above({"date": "2026-11-20", "time": "08:04:00"}, BERLIN)[1].at == EIGHT
    assert moment_above({"operator": "Mori"}, BERLIN) is None
    with pytest.raises(UnclearMomentError):
        moment_above({"date": "yesterday"}, BERLIN)


@pytest.mark.parametrize("stem", ["a_ccw_2026-11-20_0804", "20261120-080400_a", "dbb 2026-11-20 08.04 a"])
def test_names_of_files(stem):
    assert moment_in_name(stem, BERLIN).at == EIGHT


@pytest.mark.parametrize("stem", ["a_ccw_1", "serial20991", "12345678901", "x_2026-19-40"])
def test_numbers_that_are_no_dates(stem):
    assert moment_in_name(stem, BERLIN) is None


def test_zones():
    assert zone_named("+01:00") == BERLIN
    assert datetime(2026, 7, 1, tzinfo=zone_named("Europe/Berlin")).utcoffset() == timedelta(hours=2)
    with pytest.raises(UnclearMomentError):
        zone_named("Mars/Base")
