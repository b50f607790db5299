"""Numbers and dates of a bar are checked when they are typed."""

from __future__ import annotations

from datetime import date

import pytest

from dbbstation.service.bar_calibration import doubt_of, fault_of

TODAY = date(2026, 11, 24)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("calibrator_mm", "150,0003", ""),
        ("calibrator_mm", "100.0003", "the bar reads 150.0012 mm: it does not stand on a calibrator of 100.0003 mm"),
        ("calibrator_mm", "0.15", "it looks like m"),
        ("calibrator_mm", "about 150", "is no number"),
        ("calibrator_u_um", "0.25", ""),
        ("calibrator_u_um", "500", "0.001 to 100 µm"),
        ("temp_c", "20.5", ""),
        ("temp_c", "293.7", "it looks like kelvin"),
        ("certified", "2026-03-01", ""),
        ("certified", "1.3.2026", "is no date"),
        ("certified", "2027-03-01", "is of the future"),
        ("valid_until", "2027-03-01", ""),
        ("valid_until", "", ""),
        ("valid_until", "2026-11-23", "was valid until 2026-11-23 only"),
        ("serial_number", "anything", ""),
    ],
)
def test_what_is_typed_is_checked(name: str, text: str, says: str) -> None:
    found = fault_of(name, text, 150.0012, 2.0, TODAY)
    assert says in found
    assert bool(says) is bool(found)


def test_a_reading_that_knows_no_length_says_nothing_of_the_calibrator() -> None:
    assert fault_of("calibrator_mm", "100.0003", None) == ""
    assert fault_of("calibrator_mm", "145.0", 150.0) == ""  # within the travel of a gauge of which none is stated
    assert fault_of("calibrator_mm", "145.0", 150.0, 2.0) != ""


def test_an_old_certificate_is_asked_about() -> None:
    assert doubt_of("certified", "2024-11-01", TODAY) == ""
    assert "is 7 years old" in doubt_of("certified", "2019-11-20", TODAY)
    assert doubt_of("temp_c", "20") == ""
