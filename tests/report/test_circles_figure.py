"""Sheets of `circles --figure`: labels keep off one another, title blocks say what the session says, both directions are drawn."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from dbbstation.circles.budget import spectrum_of
from dbbstation.circles.path import Filter
from dbbstation.report.circles_figure import PlotKind, Plotted, draw_circles
from dbbstation.report.drawing import in_style
from dbbstation.report.sheet import Box, place_labels, width_of_in, wrapped
from dbbstation.tasks.circle_runs import load_circles
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import table_ii_plan
from tests.plant.session import record


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plotted")
    paths = [folder / "before", folder / "after"]
    record(paths[0], seed=4, plan=table_ii_plan(4), mechanisms=[RandomKinematics()], rate_hz=5.0)
    record(paths[1], seed=5, plan=table_ii_plan(4), rate_hz=5.0)
    return load_circles(paths, Filter.NONE)


def only(found, sessions, tests=None):
    taken = tuple(
        one for one in found.circles if one.session in sessions and (tests is None or one.entry.test in tests)
    )
    return replace(found, circles=taken, sessions=tuple(s for s in found.sessions if s.name in sessions))


def drawn(kind, found):
    with in_style():
        figure = draw_circles(Plotted(kind, found, Filter.NONE))
        FigureCanvasAgg(figure).draw()
    return figure


def texts_of(figure):
    """Texts that are seen, with their boxes as laid out; ticks beyond the ends of an axis are not."""
    every = figure.findobj(Text)
    beyond = {label for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for label in unseen_of(axis)}
    renderer = figure.canvas.get_renderer()
    seen = [one for one in every if one.get_text().strip() and one.get_visible() and one not in beyond]
    return [(one.get_text(), one.get_window_extent(renderer)) for one in seen]


def unseen_of(axis):
    low, high = sorted(axis.get_view_interval())
    places = axis.get_majorticklocs()
    labels = [tick.label1 for tick in axis.get_major_ticks()]
    return [
        label for place, label in zip(places, labels, strict=False) if not low - 1e-9 <= place <= high + 1e-9
    ] + labels[len(places) :]


def overlapping(figure):
    boxes = texts_of(figure)
    return [
        (one, other)
        for (one, a), (other, b) in itertools.combinations(boxes, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 0.5 and min(a.y1, b.y1) - max(a.y0, b.y0) > 0.5
    ]


@pytest.mark.parametrize("kind", list(PlotKind))
@pytest.mark.parametrize("tests", [{"a"}, {"a", "b"}, None])
def test_no_label_covers_another_or_leaves_the_sheet(kind, tests, found):
    of = found if kind is PlotKind.COMPARE else only(found, {"before"}, tests)
    if kind is PlotKind.COMPARE:
        of = only(found, {"before", "after"}, tests or {"a", "f", "k"})
    figure = drawn(kind, of)
    assert overlapping(figure) == []
    width, height = figure.canvas.get_width_height()
    for text, box in texts_of(figure):
        assert 0 <= box.x0 <= box.x1 <= width, text
        assert 0 <= box.y0 <= box.y1 <= height, text


@pytest.mark.parametrize("kind", [PlotKind.POLAR, PlotKind.MAP])
def test_no_label_covers_another_where_texts_are_long(kind, found):
    of = only(found, {"before"})
    session = replace(
        of.sessions[0], operator="a very long name of an operator " * 20, serial_number="0123456789" * 20, name="before"
    )
    figure = drawn(kind, replace(of, sessions=(session,)))
    assert overlapping(figure) == []
    assert any(text.endswith("…") for text, _ in texts_of(figure))


def test_a_dollar_sign_is_no_formula(found):
    of = only(found, {"before"}, {"a"})
    session = replace(of.sessions[0], operator="$x_2$ two")
    assert "$x_2$ two" in {text for text, _ in texts_of(drawn(PlotKind.POLAR, replace(of, sessions=(session,))))}


@pytest.mark.parametrize("kind", [PlotKind.POLAR, PlotKind.DEVIATION])
def test_both_directions_and_repeats_stand_in_one_picture(kind, found):
    of = only(found, {"before"}, {"a"})
    many = tuple(replace(one, entry=replace(one.entry, repeat=k)) for k in range(1, 101) for one in of.circles)
    figure = drawn(kind, replace(of, circles=many))
    widths = [line.get_linewidth() for axes in figure.axes for line in axes.lines if len(line.get_xdata()) > 10]
    assert sorted(widths) == [*[0.35] * 38, 1.0, 1.0]
    assert len(figure.axes) == 1
    words = [text for text, _ in texts_of(figure)]
    assert "160 earlier repeats are not drawn" in words
    assert "thin: earlier repeats" in words
    assert overlapping(figure) == []


def test_the_traces_are_those_of_the_circles(found):
    of = only(found, {"before"}, {"k"})
    (axes,) = drawn(PlotKind.DEVIATION, of).axes
    for line, one in zip(axes.lines, of.circles, strict=True):
        where = int(np.argmax(one.analysis.residual_um))
        top = int(np.argmax(line.get_ydata()))
        assert line.get_ydata()[top] == pytest.approx(one.analysis.residual_um[where])
        assert line.get_xdata()[top] == pytest.approx(one.analysis.path.theta_deg[where])


def test_compared_circles_have_one_scale(found):
    figure = drawn(PlotKind.COMPARE, only(found, {"before", "after"}, {"a"}))
    rings = [sorted(patch.radius for patch in axes.patches) for axes in figure.axes[:2]]
    assert rings[0] == rings[1]
    assert len(rings[0]) == 3


def test_amplitudes_of_undulations(found):
    """3 cos 2θ + 0.5 sin 7θ of white noise 0.2 µm: closed form of amplitude and of the noise's amplitude 2 s / sqrt(n)."""
    one = found.circles[0].analysis
    theta = np.radians(one.raw.theta_deg)
    rng = np.random.default_rng(1)
    form = 3.0 * np.cos(2 * theta) + 0.5 * np.sin(7 * theta) + rng.normal(0.0, 0.2, len(theta))
    seen = spectrum_of(replace(one, residual_um=form, noise=replace(one.noise, slow_um=0.2)))
    noise = 2 * 0.2 / np.sqrt(len(theta))
    assert seen.noise_um == pytest.approx(noise)
    amplitude = dict(zip(seen.undulations.tolist(), seen.amplitude_um.tolist(), strict=True))
    assert amplitude[2] == pytest.approx(3.0, abs=4 * noise)
    assert amplitude[7] == pytest.approx(0.5, abs=4 * noise)
    others = [value for k, value in amplitude.items() if k not in {2, 7}]
    # A mean of 57 exponentials: 13 % either way, one standard deviation.
    assert np.mean(np.square(others)) == pytest.approx(noise**2, rel=0.5)


def test_labels_find_room_near_their_places():
    """Many labels of one place: none meets another, none leaves the area; what has no room is left out."""
    area = Box(0.0, 0.0, 3.0, 2.0)
    put = [box for box in place_labels([(1.5, 1.0)] * 40, [(0.6, 0.15)] * 40, area) if box is not None]
    assert len(put) >= 20
    assert not any(one.meets(other) for one, other in itertools.combinations(put, 2))
    assert all(area.holds(box) for box in put)
    assert place_labels([(0.5, 0.5)], [(4.0, 0.1)], area) == [None]


def test_texts_are_wrapped_to_their_width():
    with in_style():
        text = "machine of the north hall " * 3
        lines = wrapped(text, 8.0, 1.0, 9)
        assert " ".join(lines) == " ".join(text.split())
        assert max(width_of_in(line, 8.0) for line in lines) <= 1.0
        assert wrapped("x" * 500, 8.0, 1.0, 2)[1].endswith("…")
        assert wrapped(" \n", 8.0, 1.0, 2) == [""]
