"""Whatever is written reads back as it was, within the rounding of its decimals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.registry import dialect_named
from dbbstation.nc.toolpath import RowKind, Toolpath, ToolpathBuilder

LINEAR = st.floats(-2000.0, 2000.0)
ANGLE = st.floats(-180.0, 180.0)
POSE = st.tuples(LINEAR, LINEAR, LINEAR, ANGLE, ANGLE, ANGLE).map(np.array)
FEED = st.floats(1e-3, 1e5)
TEXT = st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1, max_size=30)
STEP = st.one_of(
    st.tuples(st.just(RowKind.RAPID), POSE),
    st.tuples(st.just(RowKind.FEED), POSE, FEED),
    st.tuples(st.just(RowKind.DWELL), st.floats(0.0, 100.0)),
    st.tuples(st.just(RowKind.PAUSE), TEXT),
    st.tuples(st.just(RowKind.COMMENT), TEXT),
)


def built(first: np.ndarray, steps: list[tuple]) -> Toolpath:
    path = ToolpathBuilder("drawn")
    path.rapid(first)
    for kind, *content in steps:
        if kind == RowKind.RAPID:
            path.rapid(content[0])
        elif kind == RowKind.FEED:
            path.feed(content[0][None], content[1])
        elif kind == RowKind.DWELL:
            path.dwell(content[0])
        else:
            path.say(kind, content[0])
    return path.built()


@given(first=POSE, steps=st.lists(STEP, max_size=30))
@settings(max_examples=150, deadline=None)
def test_linuxcnc_reads_back_what_was_written(first, steps):
    written = built(first, steps)
    dialect = dialect_named("linuxcnc")
    text = dialect.write(written)
    read = dialect.read(text, "drawn.ngc")
    np.testing.assert_array_equal(read.kind, written.kind)
    np.testing.assert_allclose(read.poses[:, :3], written.poses[:, :3], rtol=0.0, atol=0.5001e-6)
    np.testing.assert_allclose(read.poses[:, 3:], written.poses[:, 3:], rtol=0.0, atol=0.5001e-7)
    np.testing.assert_allclose(read.feed, written.feed, rtol=1e-6)
    np.testing.assert_allclose(read.dwell_s, written.dwell_s, rtol=1e-6, atol=1e-15)
    assert read.text == written.text
    assert dialect.write(replace(read, holds=None)) == text


@pytest.mark.parametrize("step", [4, pytest.param(1, marks=pytest.mark.nightly)])
def test_a_run_reads_back_within_half_a_nanometre(linuxcnc, all_runs, step):
    for circle in all_runs[::step]:
        path = circle_toolpath(circle, "run")
        read = linuxcnc.read(linuxcnc.write(path), "run.ngc")
        assert np.abs(read.poses - path.poses)[:, :3].max() <= 0.5001e-6
        assert abs(read.end_s[-1] - path.end_s[-1]) < 1e-5
