"""What a diagnosis may not call in: periods that no run sweeps, amplitudes beyond all bounds, laws followed to the last digit."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import calibrate, default_sources
from dbbstation.diagnosis.channel import CircleChannel
from dbbstation.diagnosis.shapes import AWAY_MM, TOWARDS, Spring, ranges, samples_of, shapes
from dbbstation.diagnosis.verdicts import CircleJudge
from dbbstation.inference.levels import (
    Acts,
    DifferenceFound,
    Differs,
    Followed,
    FollowsAnswer,
    Levels,
    Verdict,
)
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from studies.diagnosed import diagnose_sessions
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.outsiders import HoseDrag
from tests.plant.mechanisms.perturbed import ByLoad
from tests.plant.session import record

KINEMATICS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)


def recorded_with(folder, seed, *mechanisms, rate_hz=10.0):
    record(folder, seed=seed, mechanisms=[KINEMATICS, *mechanisms], rate_hz=rate_hz)
    return load_sessions([folder])


def test_a_signal_period_is_one_that_is_sold(tmp_path):
    recorded = recorded_with(tmp_path / "s", 61)
    cyclic = sources_named(["bar-cyclic"])
    start = {"bar-cyclic": np.array([0.02, 0.02, 20.0])}
    fit = calibrate(recorded.machine, recorded.observations, [*default_sources(), *cyclic], start)
    (term,) = [term for term in fit.layout.terms if term.source.name == "bar-cyclic"]
    assert fit.x[term.columns][2] == pytest.approx(20.0, rel=0.01)
    channel = CircleChannel(calibrate(recorded.machine, recorded.observations), cyclic)
    swept_um = np.median([1e3 * np.ptp(o.raw.length_mm) for o in recorded.observations])
    periods = [variant.nonlinear[0] for variant in channel.named[0].variants]
    assert periods
    assert max(periods) <= swept_um


def test_amplitudes_of_a_joint_fit_are_bounded_where_nothing_else_bounds_them(tmp_path):
    recorded = recorded_with(tmp_path / "s", 62)
    joints = sources_named(["platform-joints"])
    plausible = np.array([p.plausible for p in joints[0].parameters(recorded.machine)])
    start = {"platform-joints": np.zeros(len(plausible))}
    every = [*default_sources(), *joints]
    fit = calibrate(recorded.machine, recorded.observations, every, start, amplitudes_within=3.0)
    (term,) = [term for term in fit.layout.terms if term.source.name == "platform-joints"]
    sigma = np.sqrt(np.diag(fit.solution.covariance))[term.columns]
    assert np.all(sigma <= 3.0 * plausible * (1.0 + 1e-9))
    assert np.all(np.abs(fit.x[term.columns]) < 9.0 * plausible)


@pytest.mark.nightly  # bounds of amplitudes are in CI
def test_contacts_that_stiffen_under_load_call_in_no_second_cause(tmp_path):
    """Compliance that falls by some per cent with the load is what `form_uncertainty` of gravity says, not play."""
    record(
        tmp_path / "s",
        seed=63,
        mechanisms=[KINEMATICS, ByLoad(Gravity(9.68e-6), 0.03)],
        rate_hz=10.0,
    )
    summary = diagnose_sessions([tmp_path / "s"], None, (), lambda _: None).summary()
    assert {s["name"] for s in summary["sources"] if s["verdict"] == "identified"} == {"gravity"}


def test_a_pull_towards_a_place_is_what_statics_says(tmp_path):
    clean = load_sessions([_still(tmp_path / "clean")])
    channel = CircleChannel(calibrate(clean.machine, clean.observations), ())
    runs = [
        samples_of(v, m, channel.machine, r)
        for v, m, r in zip(channel.variables, channel.motions, channel.readings, strict=True)
    ]
    every = shapes(ranges(runs))
    assert {s.form.about for s in every if isinstance(s.form, Spring)} == {AWAY_MM}
    hose = load_sessions([_still(tmp_path / "hose", HoseDrag(40.0, anchor_mm=(230.0, 870.0, -600.0)))])
    pulled = np.concatenate(
        [a.raw.length_mm - b.raw.length_mm for a, b in zip(hose.observations, clean.observations, strict=True)]
    )
    base = channel.columns.base
    axes = np.linalg.qr(base / np.linalg.norm(base, axis=0))[0]

    def beside(columns):
        return columns - axes @ (axes.T @ columns)

    def left_by(shape):
        columns, target = beside(np.vstack([shape.columns(run) for run in runs])), beside(pulled)
        found = np.linalg.lstsq(columns, target, rcond=1e-10)[0]
        return np.linalg.norm(target - columns @ found) / np.linalg.norm(target)

    towards = {shape.form.towards_deg: left_by(shape) for shape in every if shape.moves == TOWARDS}
    curves = [left_by(shape) for shape in every if shape.variable == "strut-length" and shape.strut]
    assert min(towards.values()) < 0.4
    assert min(towards.values()) < 0.6 * min(curves)


def _still(folder, *mechanisms):
    record(folder, seed=64, mechanisms=mechanisms, setup=(), rate_hz=4.0, angles=True)
    return folder


@pytest.mark.parametrize(("group", "verdict"), [((), Verdict.NOT_TESTABLE), (("backlash",), Verdict.AMBIGUOUS)])
def test_only_a_group_of_which_one_is_there_is_ambiguous(group, verdict):
    judge = object.__new__(CircleJudge)
    undecided = Followed((("strut-force",),), (), FollowsAnswer.UNDECIDED, 0.7, {}, 1.0, ("play",))
    levels = Levels(
        DifferenceFound(Differs.YES, "", 1.0, 1.0, matters_stated=False, independent_samples=900.0, detectable=()),
        (undecided,),
        None,
    )
    judge._levels = levels
    judge._classes, judge._rows, judge._acts = {"play": ("play",)}, "tests", lambda _: Acts.ALWAYS
    judge._joint = SimpleNamespace(unmodelled=SimpleNamespace(follows={}))
    judge._alternatives = SimpleNamespace(probability=lambda _: 0.7, ambiguity=lambda _: group)
    cause = SimpleNamespace(name="play")
    found, others, text = judge._verdict(cause, object(), 0.7, 9.0)
    assert (found, others) == (verdict, group)
    assert ("open" in text) is not bool(group)
