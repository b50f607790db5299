"""The bar on its calibrator, read over a real line by the code of `dbbstation bar`; and whether it is seated before a run."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from dbbstation.files.formats.bar import read_bar
from dbbstation.instrument.library import load_instrument
from dbbstation.instrument.protocol import Protocol
from dbbstation.service.bar_calibration import BarCalibration
from dbbstation.service.front import Front
from dbbstation.service.held_line import HeldLine
from dbbstation.service.memory import Memory
from dbbstation.station import events
from dbbstation.station.detector import seat
from dbbstation.tui.reading_panel import ReadingPanel
from dbbstation.virtual.wire import VirtualInstrument
from tests.tui.happenings import Happening, make_plan

CALIBRATOR_MM = 150.0003
OF_BAR = {"serial_number": "DBB-0042", "temp_c": 20.3, "temp_uncertainty_k": 0.2, "expansion_um_m_k": 11.5}
CALIBRATOR = {"serial_number": "ZB-17", "length_mm": CALIBRATOR_MM, "uncertainty_um": 0.25, "certified": "2026-03-01"}
TYPED = {"serial_number": "DBB-0042", "calibrator": "ZB-17", "calibrator_mm": "150,0003", "calibrator_u_um": "0.25"}
TYPED |= {"certified": "2026-03-01", "valid_until": "", "temp_c": "20.3"}
"""The same, as the operator types it."""
PATIENCE_S = 30.0
COUNT = 40


@pytest.fixture
def protocol() -> Protocol:
    return load_instrument("streaming-encoder")


def until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def test_what_the_bar_reads_too_long_is_written_into_its_file(protocol: Protocol, tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    long_mm = 0.0021
    path = tmp_path / "bar.yaml"
    with (
        VirtualInstrument(protocol, lambda _t_s: CALIBRATOR_MM + long_mm + rng.normal(0.0, 2e-4)) as wire,
        closing(HeldLine(protocol, wire.port)) as line,
    ):
        calibration = BarCalibration(line, count=COUNT)
        try:
            until(lambda: calibration.latest is not None)
            calibration.begin(*Front(tmp_path, Memory(tmp_path / "state.json")).stated_bar(TYPED), path)
            until(lambda: calibration.found is not None or calibration.failure is not None)
        finally:
            calibration.close()
    assert calibration.failure is None
    found, file = calibration.found, read_bar(path)
    # Readings scatter by 0.2 µm: the mean of forty is good to 0.03 µm, four times that is hardly ever passed.
    assert found.long_um == pytest.approx(1e3 * long_mm, abs=0.13)
    assert file.readings.count == COUNT
    assert 1e3 * (file.readings.mean_mm - CALIBRATOR_MM) == pytest.approx(found.long_um)
    assert found.u_um == pytest.approx(1e3 * file.uncertainty_mm)
    assert (file.serial_number, file.calibrator.serial_number, file.calibrator.length_mm) == (
        "DBB-0042",
        "ZB-17",
        150.0003,
    )


def test_no_bar_a_wrong_date_and_a_file_that_exists_are_told(protocol: Protocol, tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    there = tmp_path / "there.yaml"
    there.write_text("")
    length_mm: list[float | None] = [None]
    with (
        VirtualInstrument(
            protocol, lambda _t_s: None if length_mm[0] is None else length_mm[0] + rng.normal(0.0, 2e-4)
        ) as wire,
        closing(HeldLine(protocol, wire.port)) as line,
    ):
        calibration = BarCalibration(line, count=COUNT)
        try:
            for calibrator, path, says in (
                (CALIBRATOR, tmp_path / "bar.yaml", "are a length"),
                ({**CALIBRATOR, "certified": "last year"}, tmp_path / "bar.yaml", "certified"),
                (CALIBRATOR, there, "exists"),
            ):
                calibration.begin(OF_BAR, calibrator, path)
                until(lambda: not calibration.busy)
                assert says in str(calibration.failure)
                length_mm[0] = CALIBRATOR_MM
        finally:
            calibration.close()
    assert not (tmp_path / "bar.yaml").exists()


def test_leaving_gives_the_instrument_back(protocol: Protocol, tmp_path: Path) -> None:
    with VirtualInstrument(protocol, lambda _t_s: 150.0) as wire, closing(HeldLine(protocol, wire.port)) as line:
        calibration = BarCalibration(line, count=1_000_000)
        calibration.begin(OF_BAR, CALIBRATOR, tmp_path / "bar.yaml")
        until(lambda: calibration.done > 0)
        began_s = time.monotonic()
        calibration.close()
        assert time.monotonic() - began_s < PATIENCE_S
    assert not (tmp_path / "bar.yaml").exists()


@pytest.mark.parametrize(
    ("length_mm", "says"),
    [
        (151.5, "seated"),
        (151.0, "seated"),
        (150.8, "0.7 mm short of feed-in"),
        (149.4, "2.1 mm short of feed-in"),
        (153.0, "1.5 mm beyond feed-in"),
        (148.5, "short: counts the wrong way?"),
    ],
)
def test_before_a_run_the_reading_says_whether_the_bar_is_seated(length_mm: float, says: str) -> None:
    circle = make_plan().tests["t0"].circle  # a bar of 150 mm, fed in by 1.5 mm
    assert seat(length_mm, circle).seated is (says == "seated")
    board = Happening().board()
    board.take(events.ReadingsSeen((events.Sample(0.0, length_mm),)))
    assert says in ReadingPanel(clock=lambda: 0.0).text(board).plain.splitlines()[0]


def test_a_reading_that_is_none_of_the_calibrator_is_not_written(protocol: Protocol, tmp_path: Path) -> None:
    """Typed before the bar was put on, when nothing could be held against it: a calibrator of 100 mm, a bar of 150 mm."""
    path = tmp_path / "bar.yaml"
    rng = np.random.default_rng(9)
    with (
        VirtualInstrument(protocol, lambda _t_s: CALIBRATOR_MM + rng.normal(0.0, 2e-4)) as wire,
        closing(HeldLine(protocol, wire.port)) as line,
    ):
        calibration = BarCalibration(line, count=COUNT)
        try:
            calibration.begin(OF_BAR, {**CALIBRATOR, "length_mm": 100.0003}, path)
            until(lambda: calibration.found is not None or calibration.failure is not None)
        finally:
            calibration.close()
    assert calibration.found is None
    assert "on a calibrator of 100 mm" in str(calibration.failure)
    assert not path.exists()
