"""Where nothing that is listed explains the recordings, a diagnosis ends soon, gives no name, and says where the most of it is."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.diagnosis.channel import CircleChannel
from dbbstation.diagnosis.shapes import ranges, samples_of, shapes
from dbbstation.tasks.diagnose import diagnose_sessions
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.disturbances import KinkedStrut, WanderingBar
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record

KINEMATICS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "strut", "variable"),
    [
        (KinkedStrut(strut=3), 3, "strut-length"),
        pytest.param(WanderingBar(), None, "time of the reading", marks=pytest.mark.nightly),
    ],
)
def test_what_grows_without_end_gets_no_name_and_a_place(tmp_path, hidden, strut, variable):
    record(tmp_path / "s", seed=1508, mechanisms=[KINEMATICS, hidden], rate_hz=10.0)
    diagnosed = diagnose_sessions([tmp_path / "s"], None, (), lambda _: None)
    found, summary = diagnosed.diagnosis, diagnosed.summary()
    assert {str(source.verdict) for source in found.sources} == {"not-testable"}
    assert found.after is found.before
    assert found.mismatch
    assert (found.unexplained.strut, found.unexplained.variable) == (strut, variable)
    assert "Nothing that is listed" in found.unexplained.text
    assert summary["second_start_agrees"] is None
    assert summary["next_test"] is None


def test_a_curve_that_all_struts_follow_has_the_points_of_one_variable(tmp_path):
    """Struts of different lengths and loads follow one curve: its points are values of the variable and not of each strut's range."""
    record(tmp_path / "s", seed=1, mechanisms=[], rate_hz=4.0)
    recorded = load_sessions([tmp_path / "s"])
    channel = CircleChannel(calibrate(recorded.machine, recorded.observations), ())
    runs = [samples_of(m, channel.machine, r) for m, r in zip(channel.motions, channel.readings, strict=True)]
    alike = [s for s in shapes(ranges(runs)) if s.variable in {"strut-length", "strut-force"} and s.strut is None]
    assert {s.variable for s in alike} == {"strut-length", "strut-force"}
    for shape in alike:
        points = shape.form.points(0.0, 0.0)
        every = [run.values[shape.variable] for run in runs]
        assert points[0] == pytest.approx(min(values.min() for values in every))
        assert points[-1] == pytest.approx(max(values.max() for values in every))
        # One at its own point and zero at the others.
        assert shape.form.columns(points) == pytest.approx(np.eye(len(points)))
