"""The tasks of a notebook, as they are written there."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import dbbstation as dbb
from dbbstation.files.formats.session import RunState
from dbbstation.files.recordings.session import read_session
from tests.once import OF_SESSIONS, OF_TABLES, computed_once

SMALL, MODEL = Path("fixtures/sessions/small"), Path("fixtures/models/small.yaml")
PLAN = SMALL / "plan.yaml"


class Frame:
    """What all DataFrames have in common."""

    def __init__(self, columns):
        self._columns = columns
        self.columns = list(columns)

    def __getitem__(self, name):
        return self._columns[name]


@pytest.fixture(scope="module", autouse=True)
def kept(tmp_path_factory):
    """Calls that the notebook has, too, are answered once."""
    with pytest.MonkeyPatch.context() as patch:
        computed_once(tmp_path_factory, patch, *OF_SESSIONS, *OF_TABLES)
        yield


@pytest.fixture(scope="module")
def calibrated():
    return dbb.calibrate(SMALL, sources="strut-reference-length")


@pytest.fixture
def curve():
    """A simulation that lacks a law in x: 3 µm per mm², beside noise of 1 µm."""
    rng = np.random.default_rng(4)
    x = rng.uniform(-2.0, 2.0, 400)
    simulated = 10.0 * x
    return {"x_mm": x, "sim_um": simulated, "meas_um": simulated + 3.0 * x**2 + rng.standard_normal(400)}


def test_a_calibration_is_shown_in_one_line_asked_by_name_and_saved(calibrated, tmp_path):
    assert repr(calibrated).startswith("<CalibrationResult: 6 parameters, leaves ")
    assert "\n" not in repr(calibrated)
    first = next(iter(calibrated.parameters))
    assert calibrated.parameters[first].unit == "mm"
    assert calibrated.headline() in calibrated._repr_html_()
    assert first.partition(".")[2] in calibrated.summary()
    calibrated.save(tmp_path / "model.yaml")
    again = dbb.read_model(tmp_path / "model.yaml")
    assert again.model.sources[0].source.name == "strut-reference-length"
    with pytest.raises(dbb.StationError, match="exists"):
        calibrated.save(tmp_path / "model.yaml")


def test_a_diagnosis_goes_on_from_what_was_read_and_has_causes_by_name(calibrated):
    why = dbb.diagnose(calibrated.recorded, sources=["gravity"], held_out=False)
    assert why.sources["gravity"] is next(one for one in why.sources if one.name == "gravity")
    assert why.sources["gravity"].verdict in why.summary()
    with pytest.raises(KeyError, match="did you mean 'gravity'"):
        why.sources["gravty"]
    assert why.to_dict()["sources"][0]["name"] == why.sources[0].name


def test_columns_in_memory_are_compared_as_those_of_a_file(curve, tmp_path):
    names = list(curve)
    rows = [",".join(names), *(",".join(map(repr, map(float, row))) for row in zip(*curve.values(), strict=True))]
    (tmp_path / "run.csv").write_text("\n".join(rows) + "\n")
    fields = np.rec.fromarrays(list(curve.values()), names=names)
    asked = {"measured": "meas_um", "simulated": "sim_um", "held_out": False}
    found = [dbb.mismatch(data, **asked) for data in (tmp_path / "run.csv", curve, Frame(curve), fields)]
    first, *others = (one.to_json().replace("run.csv", "table 1") for one in found)
    assert all(one == first for one in others)
    assert found[0].mismatch
    assert repr(found[1]).startswith("<MismatchResult: ")


def test_times_become_seconds(curve):
    begun = np.datetime64("2026-11-27T10:00:00") + np.arange(400) * np.timedelta64(500, "ms")
    found = dbb.mismatch({**curve, "t": begun}, "meas_um", "sim_um", time="t", held_out=False)
    (time,) = [one for one in found.variables if one.name == "t"]
    assert (time.low, time.high) == (0.0, 199.5)


def test_panels_are_drawn_into_given_axes(curve):
    _, (left, right) = plt.subplots(1, 2)
    assert dbb.mismatch(curve, "meas_um", "sim_um", held_out=False).plot(left, panel="rows") is left
    circles = dbb.circles(SMALL, tests="a")
    assert circles.plot(right, panel="a ccw") is right
    assert right.get_title().startswith("a ccw 1: G(LS) ")
    with pytest.raises(dbb.ArgumentError, match="'z' is not one of 'a ccw 1'"):
        circles.plot(right, panel="z")
    round_axes = plt.figure().add_subplot(projection="polar")
    circles.plot(round_axes)
    assert np.abs(round_axes.lines[0].get_xdata()).max() <= 2.0 * np.pi + 1e-9
    with pytest.raises(dbb.StationError, match="one panel has the deviation of one run, not a map"):
        dbb.circles(SMALL, tests="a", kind="map").plot(right)
    assert len(circles.plot().axes) == len({run.test for run in circles.runs})
    plt.close("all")


def test_a_program_in_memory_is_compensated():
    text = "G21 G90 G94 F500\nG1 X0 Y0 Z-1000 A0 B0 C0\nG1 X20\nM2\n"
    done = dbb.compensate(dbb.Program(text), MODEL, prefer="position-only")
    assert done.greatest_correction_um == done.programs[0].greatest_correction_um > 0.0
    assert done.text.count("\n") >= text.count("\n")
    assert repr(dbb.Program(text)) == "<Program program.ngc: 4 lines>"


def test_a_text_is_no_file_of_a_program():
    with pytest.raises(dbb.ArgumentError, match=r"a text is given as `Program\(text\)`"):
        dbb.compensate("G21 G90\nM2\n", MODEL)


def test_two_sessions_are_compared(tmp_path):
    dbb.simulate(MODEL, PLAN, tests=["a", "g"]).save(tmp_path / "friday")
    diff = dbb.compare(SMALL, tmp_path / "friday", held_out=False)
    assert diff.headline() == diff.text
    assert diff.differ in {True, False}
    assert type(diff.plot()).__name__ == "ShownFigure"


def test_a_history_is_a_table():
    trend = dbb.history("fixtures/sessions", false_alarms=0.01)
    assert {"machine", "started", "quantity", "value", "u", "event"} <= set(trend.rows()[0])
    with pytest.raises(dbb.ArgumentError, match="at most"):
        dbb.history("fixtures/sessions", false_alarms=2.0)


def test_poses_are_predicted_from_arrays_and_frames():
    poses = np.array([[0.0, 0.0, -1000.0, 0.0, 0.0, 0.0], [50.0, 20.0, -990.0, 2.0, 0.0, 0.0]])
    there = dbb.predict(MODEL, poses)
    assert (there.actual - poses).shape == (2, 6)
    frame = Frame(dict(zip(("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"), poses.T, strict=True)))
    np.testing.assert_array_equal(dbb.predict(MODEL, frame).actual, there.actual)
    with pytest.raises(dbb.ArgumentError, match="rows of six"):
        dbb.predict(MODEL, poses[:, :5])


def test_one_circle_from_arrays_has_the_figures_of_the_session():
    session = read_session(SMALL)
    (run,) = (one for one in session.in_state(RunState.ACCEPTED) if (one.test, one.direction) == ("a", "ccw"))
    recording, planned = session.load(run).recording, session.circle(run)
    one = dbb.circle(
        recording.t_s,
        recording.length_mm,
        bar_mm=planned.bar_mm,
        feed_mm_min=planned.feed_mm_min,
        start_deg=planned.start_deg,
        overshoot_deg=planned.overshoot_deg,
        feed_in_mm=planned.feed_in_mm,
        direction="ccw",
    )
    (of_session,) = [each for each in dbb.circles(SMALL, tests="a").runs if each.direction == "ccw"]
    assert one.g_um == pytest.approx(of_session.g_um, abs=1e-9)
    assert repr(one) == f"<CircleFiguresResult: circle ccw 1, G {one.g_um:.2f} µm>"
    with pytest.raises(dbb.ArgumentError, match="one shape"):
        dbb.circle([0.0, 1.0], [150.0], bar_mm=150.0, feed_in_mm=1.5)


def test_a_simulation_stays_in_memory_until_it_is_saved(tmp_path):
    made = dbb.simulate(MODEL, PLAN, tests=["a"])
    assert list(tmp_path.iterdir()) == []
    assert list(made.recordings) == ["a ccw 1", "a cw 1"]
    made.save(tmp_path / "session")
    (kept,) = [each for each in read_session(tmp_path / "session").runs if each.direction == "ccw"]
    written = read_session(tmp_path / "session").load(kept).recording.length_mm
    np.testing.assert_allclose(made.recordings["a ccw 1"].length_mm, written, atol=1e-6)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda: dbb.calibrate(SMALL, method="jgi"), "method: 'jgi' is unknown; did you mean 'jig'"),
        (lambda: dbb.circles(SMALL, filter=77), "filter: '77' is not one of"),
        (lambda: dbb.circles(SMALL, tests=5), "tests: `5` is no name or list of names"),
        (lambda: dbb.circles(SMALL, model=MODEL), "model: `model` needs `findings`"),
        (lambda: dbb.mismatch({}, "a", "b", decimal=";"), "decimal: ';' is not one of"),
        (lambda: dbb.mismatch({}, "a", "b", known={"a": -1}), "known: `a=-1` is not understood"),
        (lambda: dbb.mismatch({}, "a", "b", most_runs=3), "most_runs: `most_runs` needs `simulator`"),
        (lambda: dbb.mismatch({}, "a", simulator="m.yaml"), "measured: `measured` cannot be combined with `simulator`"),
        (lambda: dbb.mismatch({}, matters=True), "matters: `True` is no number"),
        (lambda: dbb.identify("drive.csv", cutoff_hz=float("nan")), "cutoff_hz: nan is not a finite number"),
    ],
)
def test_a_bad_value_is_refused_under_the_name_of_its_parameter(wrong, said):
    with pytest.raises(dbb.ArgumentError) as refused:
        wrong()
    assert str(refused.value).startswith(said)
    assert isinstance(refused.value, ValueError)


@pytest.mark.parametrize("data", [{"meas_um": [], "sim_um": []}, {"meas": [1.0], "sim_um": [1.0]}])
def test_tables_without_rows_or_with_misspelt_columns_are_refused(data):
    with pytest.raises(
        dbb.StationError, match=r"table 1: there (are no rows|is no column `meas_um`; did you mean `meas`)"
    ):
        dbb.mismatch(data, "meas_um", "sim_um")


def test_an_unknown_keyword_is_what_python_has():
    with pytest.raises(TypeError, match="sesions"):
        dbb.circles(SMALL, sesions=SMALL)


def test_one_name_is_not_taken_letter_by_letter():
    with pytest.raises(dbb.StationError, match="gravty"):
        dbb.calibrate(SMALL, sources="gravty")


def test_folders_of_the_package_hide_no_public_name():
    for one in pkgutil.iter_modules(dbb.__path__):
        if not one.name.startswith("_"):
            importlib.import_module(f"dbbstation.{one.name}")
    assert all(callable(getattr(dbb, name)) for name in dbb.__all__ if name != "__version__")


def test_what_users_subclass_is_in_one_place():
    own = importlib.import_module("dbbstation.own")
    assert own.Simulator.__module__ == "dbbstation.diagnosis.simulator.contract"
    assert {"ErrorSource", "TableSource", "PortSource", "Dialect"} <= set(own.__all__)
