"""Dots against brute force: one by one, in plain loops."""

from __future__ import annotations

import unicodedata

import numpy as np
import pytest

from dbbstation.tui import braille

# Unicode names the dots of a braille pattern by number: 1 2 3 7 down the left side of a cell, 4 5 6 8 down the right.
DOT_NUMBERS = [[1, 4], [2, 5], [3, 6], [7, 8]]


def raised(character: str) -> set[tuple[int, int]]:
    """Row and column of the dots, from the character's name in the Unicode tables."""
    if character == " ":
        return set()
    numbers = unicodedata.name(character).removeprefix("BRAILLE PATTERN DOTS-")
    return {(y, x) for y in range(4) for x in range(2) if str(DOT_NUMBERS[y][x]) in numbers}


def dots_of(codes: np.ndarray) -> np.ndarray:
    plane = np.zeros((codes.shape[0] * 4, codes.shape[1] * 2), dtype=bool)
    for row in range(codes.shape[0]):
        for column in range(codes.shape[1]):
            for y, x in raised(chr(codes[row, column])):
                plane[4 * row + y, 2 * column + x] = True
    return plane


def test_every_dot_of_a_plane_is_the_dot_of_its_character(rng: np.random.Generator) -> None:
    plane = rng.random((20, 14)) < 0.3
    codes, members = braille.overlay([plane])
    assert codes.shape == (5, 7)
    np.testing.assert_array_equal(dots_of(codes), plane)
    cells = plane.reshape(5, 4, 7, 2).any(axis=(1, 3))
    np.testing.assert_array_equal(members, cells.astype(np.uint8))


def test_planes_are_ored_and_cells_tell_whose_dots_they_have(rng: np.random.Generator) -> None:
    planes = [rng.random((16, 12)) < 0.1 for _ in range(3)]
    codes, members = braille.overlay(planes)
    np.testing.assert_array_equal(dots_of(codes), planes[0] | planes[1] | planes[2])
    for row in range(4):
        for column in range(6):
            cell = np.s_[4 * row : 4 * row + 4, 2 * column : 2 * column + 2]
            assert members[row, column] == sum(2**n for n, plane in enumerate(planes) if plane[cell].any())


def test_points_light_their_dot_and_those_outside_none(rng: np.random.Generator) -> None:
    plane = braille.empty(9, 4)
    x, y = rng.uniform(-4.0, 22.0, 300), rng.uniform(-4.0, 20.0, 300)
    x[:3], y[3:6] = np.nan, np.inf
    braille.light(plane, x, y)
    expected = {(int(b), int(a)) for a, b in zip(x, y, strict=True) if 0.0 <= a < 18.0 and 0.0 <= b < 16.0}
    assert {(int(b), int(a)) for b, a in zip(*np.nonzero(plane), strict=True)} == expected


def test_a_line_has_no_hole() -> None:
    x, y = braille.connect(np.array([0.5, 17.5, 3.5]), np.array([0.5, 6.5, 15.5]))
    assert (x[:3].tolist(), y[:3].tolist()) == ([0.5, 17.5, 3.5], [0.5, 6.5, 15.5])
    order = np.concatenate([[0], np.arange(3, 19), [1], np.arange(19, len(x)), [2]])
    assert np.abs(np.diff(x[order])).max() <= 1.0
    assert np.abs(np.diff(y[order])).max() <= 1.0


def test_what_is_no_number_breaks_the_line() -> None:
    x, y = braille.connect(np.array([0.5, np.nan, 9.5]), np.array([0.5, 0.5, 9.5]))
    assert np.isfinite(x).sum() == 2
    assert len(y) == 3


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_points_for_a_line(count: int) -> None:
    x, _ = braille.connect(np.zeros(count), np.zeros(count))
    assert len(x) == count
