"""SVG bytes: shorter than Matplotlib writes them, and the same picture."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from dbbstation.report.drawing import in_style
from dbbstation.report.figure_format import _shorter, as_svg

coordinate = st.floats(-2000.0, 2000.0).map(lambda x: round(x, 6))
NUMBER = r"-?(?:\d+\.?\d*|\.\d+)"


def walked(path: str) -> list[tuple[float, float]]:
    """Points of a path as the SVG standard reads it (moves, relative steps, closing), by a reader of our own."""
    points, at, command, start = [], (0.0, 0.0), "", (0.0, 0.0)
    words = iter(re.findall(rf"[Mlz]|{NUMBER}", path))
    for word in words:
        if word == "z":
            at = start
            continue
        if word in "Ml":
            command, word = word, next(words)  # noqa: PLW2901 (the letter's first number)
        x, y = float(word), float(next(words))
        at = (x, y) if command == "M" else (at[0] + x, at[1] + y)
        start = at if command == "M" else start
        points.append(at)
    return points


@given(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=30))
def test_every_point_is_where_it_was_to_half_a_tenth(points):
    path = " \n".join(f"{'L' if k else 'M'} {x:f} {y:f}" for k, (x, y) in enumerate(points))
    there = walked(_shorter(path.encode()).decode())
    reached = {0}
    for x, y in points:
        # Points that fall together are one: each is the point of the one before, or the next.
        near = [np.allclose(one, (x, y), rtol=0.0, atol=0.0501) for one in there]
        reached = {j for k in reached for j in (k, k + 1) if j < len(there) and near[j]}
        assert reached, (x, y)
    assert np.allclose(there[-1], points[-1], rtol=0.0, atol=0.0501)


def test_steps_are_short_and_do_not_add_up_their_roundings():
    assert _shorter(b"M 1 2 \nL 1.56 2 \nL 1.59 2 \nL 1.56 1.9 \nz\n") == b"M1 2l.6 0 0-.1z"
    assert _shorter(b"M 5.04 5.04 \nL 5.04 5.04 \n") == b"M5 5l0 0"  # a dot stays one
    assert _shorter(b"M 0 0 \nL 1 0 \nM 9 9 \nL 8 9 \n") == b"M0 0l1 0M9 9l-1 0"
    many = b"M 0 0 \n" + b"".join(b"L %f 0 \n" % (0.04 * k) for k in range(1, 1001))
    assert walked(_shorter(many).decode())[-1] == pytest.approx((40.0, 0.0), abs=1e-6)


def test_round_paths_keep_their_form():
    assert _shorter(b"M 0 1.50001 \nC 0.39789 1.5 0.7787 1.3414 1.0606 1.0606 \nz") == (
        b"M 0 1.50 \nC 0.39 1.5 0.77 1.34 1.06 1.06 \nz"
    )


def test_it_is_a_third_shorter_and_loses_nothing():
    figure = Figure()
    axes = figure.add_subplot()
    axes.pcolormesh(np.random.default_rng(1).normal(size=(15, 36)))
    axes.add_patch(Circle((10.0, 5.0), 2.0))
    axes.set_title("a – title")
    with in_style():
        drawn = as_svg(figure)
        plain = io.BytesIO()
        figure.savefig(plain, format="svg")
    assert len(drawn) < 0.67 * len(plain.getvalue())
    assert ">a – title</text>" in drawn.decode()
    assert drawn.count(b"<path") == plain.getvalue().count(b"<path")
