"""Readings that were damaged on the line: recorded as they came, marked, counted, in no figure."""

from __future__ import annotations

import csv
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.cli.session import list_runs
from dbbstation.files.checking import check
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.reading import Reading
from dbbstation.plan.plan import Direction
from dbbstation.service.bar_calibration import read_on_calibrator
from dbbstation.service.board import Board
from dbbstation.station import events
from dbbstation.station.run_record import RunRecord
from dbbstation.tui.bar_screen import BarScreen
from dbbstation.tui.prepare_screen import PrepareScreen
from dbbstation.tui.reading_panel import ReadingPanel
from tests.station.readings import run_readings
from tests.station.test_no_length import recorded
from tests.trace.test_cut import CIRCLE

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

LOST_DIGIT = b"+50.123\r"
"""What `+150.123` becomes."""


def places_on_turn(plan_file: Path, share: Sequence[float]) -> list[int]:
    count = len(run_readings(read_inline_plan(plan_file).to_domain().tests["a"].circle))
    return [round(one * count) for one in share]


def test_lost_digits_cost_their_samples_and_nothing_else(plan_file: Path, tmp_path: Path) -> None:
    places = places_on_turn(plan_file, (0.01, 0.1, 0.4, 0.7))
    damaged = tmp_path / "damaged"
    statuses, (completed,) = recorded(plan_file, damaged, dict.fromkeys(places, LOST_DIGIT))
    _, (whole,) = recorded(plan_file, tmp_path / "whole", {})
    assert (statuses.count("doubtful"), set(statuses)) == (4, {"ok", "doubtful"})
    assert (completed.doubtful, completed.problem) == (4, "")
    assert completed.figures is not None
    assert whole.figures is not None
    assert completed.figures.circularity_um == pytest.approx(whole.figures.circularity_um, abs=0.01)
    assert completed.figures.mean_radial_error_um == pytest.approx(whole.figures.mean_radial_error_um, abs=0.01)
    (run,) = read_session(damaged).runs
    assert run.counts is not None
    assert run.counts.rejected == {"doubtful": 4}
    # What came stays as it came.
    lines = [line for line in run.path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    doubtful = [float(row["length_mm"]) for row in csv.DictReader(lines) if row["status"] == "doubtful"]
    assert doubtful == [50.123] * 4


def test_too_many_are_a_reason_to_repeat(plan_file: Path, tmp_path: Path) -> None:
    share = [0.2 + 0.6 * k / 20 for k in range(20)]
    places = places_on_turn(plan_file, share)
    _, (completed,) = recorded(plan_file, tmp_path / "session", dict.fromkeys(places, LOST_DIGIT))
    assert completed.figures is None
    assert "20 of " in completed.problem
    assert "samples were lost or cannot be used (" in completed.problem
    assert "more than the 0.5 % that the plan allows" in completed.problem


def test_a_bar_that_left_its_seat_is_not_hidden(plan_file: Path, tmp_path: Path) -> None:
    first, last = places_on_turn(plan_file, (0.4, 0.5))
    away = dict.fromkeys(range(first, last), b"+148.500\r")
    statuses, (completed,) = recorded(plan_file, tmp_path / "session", away)
    assert statuses.count("doubtful") <= 4
    assert completed.figures is None
    assert "the length jumps by" in completed.problem or "off the bar's" in completed.problem


def test_check_and_session_list_say_how_many(
    plan_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "session"
    recorded(plan_file, folder, dict.fromkeys(places_on_turn(plan_file, (0.3, 0.6)), LOST_DIGIT))
    list_runs.main([str(folder)], standalone_mode=False)
    assert "0 lost, 2 rejected (doubtful 2)" in capsys.readouterr().out
    told = " ".join(problem.what for problem in check(folder, {}).warnings)
    assert "2 rejected (doubtful 2)" in told
    (run,) = read_session(folder).runs
    assert "2 doubtful or no length" in check(run.path, {}).summary


def test_the_screen_counts_doubtful_samples_beside_lost_ones() -> None:
    board, panel = Board(), ReadingPanel()
    run = events.RunId("a", "ccw", 1, 1)  # type: ignore[arg-type]
    why = "its number has 2 digits before the point, the lines before had 3"
    board.take(events.SamplesRecorded(run, (events.Sample(1.0, 150.0), events.Sample(1.1, 50.123, "doubtful", why))))
    shown = panel.text(board).plain.splitlines()
    assert "50.12300 mm" in shown[0]
    assert shown[1] == f"DOUBTFUL · 0 lost · 1 doubtful · {why}"
    board.take(events.SamplesRecorded(run, (events.Sample(1.2, 150.0),)))
    assert panel.text(board).plain.splitlines()[1].endswith("0 lost · 1 doubtful")


def test_before_the_circles_a_doubtful_length_is_called_one_too() -> None:
    sample = events.Sample(1.0, 50.123, "doubtful", "2 digits before the point")
    line = SimpleNamespace(latest=sample, failure=None, rate=SimpleNamespace(per_s=None))
    checklist = SimpleNamespace(_prepared=SimpleNamespace(first=None))
    told = PrepareScreen._reading(checklist, line)  # type: ignore[arg-type]
    assert told == ("!", "The instrument reads 50.1230 mm, doubtful: 2 digits before the point.")
    bar = SimpleNamespace(_calibration=SimpleNamespace(latest=sample))
    assert BarScreen._live(bar) == "now 50.1230 mm, doubtful: 2 digits before the point"  # type: ignore[arg-type]


def test_lost_and_doubtful_samples_of_the_turn_count_together() -> None:
    record = RunRecord(events.RunId("a", Direction.CCW, 1, 1), CIRCLE, 0.0, fed_in_s=1.0)
    record.add(Reading(10.0, 150.0, lost=2))
    record.add(Reading(10.1, 50.123, "doubtful"))
    record.add(Reading(10.2, 150.0))
    assert (record.lost, record.doubtful, record.lost_on_turn) == (2, 1, 3)


def test_a_damaged_reading_does_not_shift_the_mean_of_the_bar() -> None:
    """90 µm in one of forty readings would be 2 µm of length in every circle that follows."""
    lengths = 150.0003 + np.random.default_rng(28).normal(0.0, 1e-4, 40).round(4)
    lengths[17] += 0.09

    class Source:
        where = "scripted"

        def readings(self, count: int) -> list[Reading]:
            return [Reading(0.1 * k, float(one)) for k, one in enumerate(lengths)][:count]

    found = read_on_calibrator(Source(), 40)  # type: ignore[arg-type]
    assert found.count == 39
    assert found.mean_mm == pytest.approx(150.0003, abs=1e-4)
