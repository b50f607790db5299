"""A certificate is refused for dates that cannot be right, or are too far apart, with the reason."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.new_session import FinishedRun, write_session
from dbbstation.files.recordings.session import read_session
from dbbstation.plan.bar import Bar
from dbbstation.plan.plan import Direction
from dbbstation.report.certificate import _dates, _lacking
from dbbstation.report.conditions import identity
from dbbstation.report.html import _css


@pytest.mark.parametrize(
    ("run", "bar", "calibrator", "says"),
    [
        ((2026, 11, 20), (2026, 11, 20), "2026-03-02", ()),
        ((2026, 11, 20), (2026, 11, 20), "2012-03-02", ("calibrator was certified on 2012-03-02, runs of 2026-11-20",)),
        ((2026, 11, 20), (1996, 11, 20), "2026-03-02", ("bar calibrated on 1996-11-20, runs of 2026-11-20",)),
        ((2026, 11, 20), (2026, 11, 21), "2026-03-02", ("bar calibrated on 2026-11-21, runs of 2026-11-20",)),
    ],
)
def test_dates(run, bar, calibrator, says):
    assert tuple(_dates(session(run, bar, calibrator))) == says


def test_a_run_of_the_future():
    first, *_ = _dates(session((2096, 1, 1), (2095, 12, 1), "2095-01-01"))
    assert first == "a run of 2096-01-01, which is still to come"


def test_the_last_day_of_a_certificate():
    kept = session((2026, 11, 20), (2026, 11, 20), "2012-03-02", "2026-11-20")
    assert tuple(_dates(kept)) == ()
    (late,) = _dates(session((2026, 11, 20), (2026, 11, 20), "2026-03-02", "2026-11-19"))
    assert late == "calibrator's certificate was valid until 2026-11-19, runs of 2026-11-20"


@pytest.mark.parametrize("days", [-1, 0, 21])
def test_a_seal_before_the_measurement_or_long_after_it(tmp_path, days):
    """The log dates the seal by the station's clock, the run by the clock of what recorded it."""
    plan = read_inline_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
    times = np.linspace(0.0, 60.0, 400)
    run = FinishedRun("low", Direction.CCW, {"t_s": times, "length_mm": 150.0 + 0.001 * np.sin(times)}, started=START)
    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    write_session(tmp_path / "s", machine, plan, [run], at=START + timedelta(days=days, minutes=5))
    read = read_session(tmp_path / "s")
    assert ("run low ccw 1 sealed before it was measured" in _lacking(read, "")) is (days < 0)
    assert dict(identity(read))["seal"].endswith(", 21 days after the measurement" if days > 0 else ", 0 amendments")


START = datetime(2026, 11, 3, 8, tzinfo=UTC)


def session(run, bar, calibrator, until=None):
    return SimpleNamespace(
        accepted=[SimpleNamespace(started=datetime(*run, 8, tzinfo=UTC))],
        bar=Bar(
            "B-1",
            150.0,
            5e-4,
            datetime(*bar, 7, tzinfo=UTC),
            20.0,
            1.2,
            calibrator_certified=calibrator,
            calibrator_valid_until=until,
        ),
    )


def test_a_name_cannot_end_the_string_of_a_style_sheet():
    assert _css('a"}<b') == "a\\22 \\7d \\3c b"
