"""A certificate is refused for dates that cannot be right, or are too far apart, with the reason."""

from __future__ import annotations

from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from dbbstation.plan.bar import Bar
from dbbstation.report.certificate import _dates
from dbbstation.report.html import _css


@pytest.mark.parametrize(
    ("run", "bar", "calibrator", "says"),
    [
        ((2026, 11, 20), (2026, 11, 20), "2026-03-02", ()),
        ((2026, 11, 20), (2026, 11, 20), "2012-03-02", ("calibrator certified on 2012-03-02, runs of 2026-11-20",)),
        ((2026, 11, 20), (1996, 11, 20), "2026-03-02", ("bar calibrated on 1996-11-20, runs of 2026-11-20",)),
        ((2026, 11, 20), (2026, 11, 21), "2026-03-02", ("bar calibrated on 2026-11-21, runs of 2026-11-20",)),
    ],
)
def test_dates(run, bar, calibrator, says):
    assert tuple(_dates(session(run, bar, calibrator))) == says


def test_a_run_of_the_future():
    first, *_ = _dates(session((2096, 1, 1), (2095, 12, 1), "2095-01-01"))
    assert first == "a run of 2096-01-01, which is still to come"


def session(run, bar, calibrator):
    return SimpleNamespace(
        in_state=lambda _state: [SimpleNamespace(started=datetime(*run, 8, tzinfo=UTC))],
        bar=Bar("B-1", 150.0, 5e-4, datetime(*bar, 7, tzinfo=UTC), 20.0, 1.2, calibrator_certified=calibrator),
    )


def test_a_name_cannot_end_the_string_of_a_style_sheet():
    assert _css('a"}<b') == "a\\22 \\7d \\3c b"
