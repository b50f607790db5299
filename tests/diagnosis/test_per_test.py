"""Residual, circularity and traces of each test, against their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.source_curves import gains_by_test
from dbbstation.facts.serialise import plain
from dbbstation.inference.bounds import BOUNDS
from dbbstation.results.diagnosis import diagnosis_figures
from tests.diagnosis.joint_fits import joint_fit


@pytest.fixture(scope="module")
def found(reference):
    return joint_fit(reference, ("gravity",))


def test_residuals_and_gain_of_a_test(found):
    gains = {one.name: one for one in gains_by_test(found)}
    assert list(gains) == list("abcdefghijklmno")
    rows = [k for k, o in enumerate(found.before.observations) if o.test == "h"]
    for fit, told in zip((found.before, found.after), gains["h"].residual_um, strict=True):
        square = sum(float(np.sum(fit.residual_mm[k] ** 2)) for k in rows)
        assert told == pytest.approx(1e3 * np.sqrt(square / sum(len(fit.residual_mm[k]) for k in rows)))
    assert gains["h"].gain_um == pytest.approx(gains["h"].residual_um[0] - gains["h"].residual_um[1])
    # Gravity bends these circles by micrometres; once it is found noise of 0.3 µm is left.
    assert gains["h"].residual_um[0] > 2.0
    assert gains["h"].residual_um[1] == pytest.approx(0.3, abs=0.05)


def test_circularity_left_is_that_of_the_summary(found):
    """The same numbers as `--json` has, of the worst run of a test; gravity's is gone once it is found."""
    runs = [run for run in plain(diagnosis_figures(found, {}))["circularity_um"] if run["test"] == "n"]
    (told,) = (one.circularity_um for one in gains_by_test(found) if one.name == "n")
    assert told == pytest.approx([max(run[when] for run in runs) for when in ("before", "after")])
    assert told[0] > 6.0
    assert told[1] < 2.5  # the range of 360 readings with noise of 0.3 µm


def test_traces_are_the_recording_and_both_models_by_angle(found):
    one = next(one for one in gains_by_test(found) if one.name == "b")
    assert [str(trace.direction) for trace in one.traces] == ["ccw", "cw"]
    for trace, k in zip(one.traces, [k for k, o in enumerate(found.before.observations) if o.test == "b"], strict=True):
        assert len(trace.theta_deg) == BOUNDS.trace_points
        assert np.all(np.diff(trace.theta_deg) > 0.0)
        # 360 samples: a sector holds one, so that nothing is averaged and only the order may change.
        raw = found.before.observations[k].raw
        order = np.argsort(raw.theta_deg)
        assert trace.measured_um == pytest.approx(1e3 * (raw.length_mm - raw.circle.bar_mm)[order])
        for fit, curve in ((found.before, trace.before_um), (found.after, trace.after_um)):
            assert trace.measured_um - curve == pytest.approx(1e3 * fit.residual_mm[k][order], abs=1e-9)
            predicted = fit.model.bar(fit.observations[k].motion()).length_mm - raw.circle.bar_mm
            assert curve == pytest.approx(1e3 * predicted[order], abs=1e-3)  # nodes: to a nanometre
