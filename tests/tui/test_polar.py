"""The polar trace: where samples come to lie, at which scale."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dbbstation.tui.polar import BAND_SHARE, NOMINAL_SHARE, Dial, draw_scale, draw_trace, grown_scale_um


def dot_of(dial: Dial, theta_deg: float, deviation_um: float, scale_um: float) -> tuple[int, int]:
    radius = dial.radius * (NOMINAL_SHARE + BAND_SHARE * deviation_um / scale_um)
    x = dial.columns + radius * math.cos(math.radians(theta_deg))
    y = dial.rows * 2 - radius * math.sin(math.radians(theta_deg)) / dial.dot_aspect
    return math.floor(y), math.floor(x)


@pytest.mark.parametrize(("columns", "rows"), [(40, 15), (70, 33), (23, 60), (200, 8)])
@pytest.mark.parametrize("thick", [False, True])
def test_every_sample_has_its_dot(rng: np.random.Generator, columns: int, rows: int, thick: bool) -> None:  # noqa: FBT001 - a parameter of the test
    dial = Dial(columns, rows)
    plane = dial.empty()
    theta = np.linspace(0.0, 360.0, 500)
    deviation = 15.0 * np.sin(np.radians(2.0 * theta)) + rng.normal(0.0, 2.0, 500)
    draw_trace(plane, dial, theta, deviation, 20.0, thick=thick)
    for one, other in zip(theta, deviation, strict=True):
        assert plane[dot_of(dial, one, other, 20.0)]


def test_both_directions_are_ored(rng: np.random.Generator) -> None:
    dial = Dial(50, 20)
    theta = np.linspace(0.0, 360.0, 300)
    together, ccw, cw = dial.empty(), dial.empty(), dial.empty()
    for plane, turn in ((ccw, theta), (cw, -theta)):
        deviation = rng.normal(0.0, 3.0, 300)
        draw_trace(plane, dial, turn, deviation, 10.0)
        draw_trace(together, dial, turn, deviation, 10.0)
    np.testing.assert_array_equal(together, ccw | cw)


def test_a_lost_stretch_stays_empty() -> None:
    dial = Dial(40, 20)
    plane = dial.empty()
    theta = np.array([0.0, 1.0, np.nan, 179.0, 180.0])
    draw_trace(plane, dial, theta, np.where(np.isnan(theta), np.nan, 0.0), 10.0)
    assert plane[:, 30:50].sum() == 0


def test_drawn_piece_by_piece_is_drawn_at_once(rng: np.random.Generator) -> None:
    dial = Dial(60, 25)
    theta, deviation = np.linspace(0.0, 360.0, 240), rng.normal(0.0, 4.0, 240)
    whole, pieces = dial.empty(), dial.empty()
    draw_trace(whole, dial, theta, deviation, 10.0)
    for start in range(0, 240, 30):
        part = slice(max(start - 1, 0), start + 30)
        draw_trace(pieces, dial, theta[part], deviation[part], 10.0)
    np.testing.assert_array_equal(pieces, whole)


@pytest.mark.parametrize("cell_aspect", [1.6, 2.0, 2.4])
def test_a_circle_is_as_wide_as_high_on_the_screen(cell_aspect: float) -> None:
    dial = Dial(90, 40, cell_aspect)
    plane = dial.empty()
    draw_trace(plane, dial, np.linspace(0.0, 360.0, 2000), np.zeros(2000), 10.0)
    rows, columns = np.flatnonzero(plane.any(axis=1)), np.flatnonzero(plane.any(axis=0))
    wide, high = np.ptp(columns) / 2.0, np.ptp(rows) * cell_aspect / 4.0
    assert wide == pytest.approx(high, abs=1.0)


def test_everything_of_the_scale_fits_any_size() -> None:
    for columns, rows in [(1, 1), (3, 2), (12, 5), (300, 100)]:
        dial = Dial(columns, rows)
        plane = dial.empty()
        draw_scale(plane, dial, 123.0)
        assert plane.any()
        assert 0 <= dial.cell(200.0, 5.0)[0] < rows


def test_the_start_is_marked() -> None:
    dial = Dial(60, 30)
    with_start, without = dial.empty(), dial.empty()
    draw_scale(with_start, dial, 90.0)
    draw_scale(without, dial, None)
    rows, columns = np.nonzero(with_start & ~without)
    assert set(columns) == {60}
    assert rows.max() < 60


def test_magnification_is_drawn_deviation_over_drawn_radius() -> None:
    dial = Dial(60, 30)
    # 20 µm are drawn as BAND_SHARE, 150 mm as NOMINAL_SHARE of the same radius.
    assert dial.magnification(20.0, 150.0) == pytest.approx(150.0 / 0.02 * BAND_SHARE / NOMINAL_SHARE)


@pytest.mark.parametrize(
    ("scale", "largest", "expected"),
    [
        (2, 0, 2),
        (2, 2, 2),
        (2, 2.1, 5),
        (5, 5.01, 10),
        (10, 11, 20),
        (20, 480, 500),
        (500, 3, 500),
        (1, 0.1, 2),
        (2, 1000, 1000),
    ],
)
def test_the_scale_grows_in_steps_and_never_shrinks(scale: float, largest: float, expected: float) -> None:
    assert grown_scale_um(scale, largest) == expected
