"""A table of measured and simulated values: what was put into it is found and said, and nothing else."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import Mismatch, chosen_again, find_mismatch
from dbbstation.diagnosis.table.next_measurement import next_measurements
from dbbstation.inference import looks
from dbbstation.inference.bank import Bank
from dbbstation.inference.channel import Base, Channel, Kind, Variable
from dbbstation.inference.folds import parts_of, refits_without
from dbbstation.inference.levels import FollowsAnswer, Verdict
from dbbstation.inference.looks import seen
from dbbstation.inference.read_off import Trial
from dbbstation.inference.settle import settle, static_patterns
from dbbstation.results.mismatch import mismatch_result
from dbbstation.tasks.tables import TableOptions, load_tables
from tests.diagnosis.table import plant
from tests.diagnosis.table.plant import PULSE_S, Truth, record
from tests.inference.reading import read_by_levels

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("few_parts")

ASKED = TableOptions("measured_mm", "simulated_mm")
OF_TIME = TableOptions("measured_mm", "simulated_mm", {"t_s": None, "place_mm": None})
"""Of what happens in time: the forms over other variables are searched in nightly tests only."""


@pytest.fixture(autouse=True, params=[5.0, pytest.param(20.0, marks=pytest.mark.nightly)], ids=["5 Hz", "20 Hz"])
def rate_hz(request, monkeypatch):
    """Readings a second."""
    monkeypatch.setattr(plant, "RATE_HZ", request.param)
    return request.param


FOUND = {
    "play": (Truth(play_um=8.0), {"hysteresis of place_mm", "hysteresis of simulated_mm"}, ("half width", 4e-3)),
    "twice": (Truth(twice_um=3.0), {"twice per turn of screw_deg"}, None),
    "lag": (Truth(lag_ms=0.3), {"lag of simulated_mm", "speed of place_mm"}, ("delay", 0.3e-3)),
    "temperature": (Truth(expansion_um_k=1.5), {"linear in oil_temp_c"}, ("slope", 1.5e-3)),
    "product": (
        Truth(load_by_place_um=6.0),
        {"product of place_mm and load_n", "product of load_n and simulated_mm"},
        None,
    ),
    "drift": (Truth(drift_um_min=8.0), {"drift with t_s"}, ("slope", 8e-3 / 60.0)),
}


def found_in(tmp_path: Path, *truths: Truth, asked: TableOptions = ASKED, derivative: bool = False) -> Mismatch:
    paths = [
        record(truth, seed, derivative=derivative).write(tmp_path / f"run{seed}.csv")
        for seed, truth in enumerate(truths, start=3)
    ]
    return find_mismatch(load_tables(paths, asked).table, hold_out=False)


@pytest.mark.parametrize(
    ("seed", "correlation"),
    [(1, 0.0), (2, 0.8), *(pytest.param(*case, marks=pytest.mark.nightly) for case in ((1, 0.8), (2, 0.0)))],
)
def test_a_clean_table_has_no_mismatch(tmp_path, seed, correlation):
    path = record(Truth(correlation=correlation), seed).write(tmp_path / "clean.csv")
    found = find_mismatch(load_tables([path], ASKED).table, hold_out=False)
    assert not found.there
    assert not found.is_there
    assert found.left.is_noise
    assert not found.offset_is_there
    assert found.settled.noise.sigma == pytest.approx(2e-3, rel=0.15)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.nightly if n in {"lag", "twice"} else ()) for n in FOUND]
)
def test_a_form_is_found_by_its_name_with_its_size(tmp_path, name):
    truth, names, value = FOUND[name]
    found = found_in(tmp_path, truth)
    assert found.is_there
    assert len(found.there) == 1
    (finding,) = found.there
    # Names that say the same of this table: place and simulated place are one.
    assert finding.name in names
    # No other rows can test what follows the time alone.
    assert finding.verdict is (Verdict.HAPPENED if name == "drift" else Verdict.IDENTIFIED)
    text = next(f.text for f in mismatch_result(found).findings if f.name == finding.name)
    assert ("no other rows can test it" in text) == (name == "drift")
    assert found.left.is_noise
    if value is not None and value[0] in finding.values:
        known = finding.values[value[0]]
        assert abs(known.value - value[1]) < 4.0 * known.uncertainty


def test_what_is_measured_late_has_a_delay_that_is_positive(rng):
    """The same function of time, 30 ms later."""
    seconds = np.arange(500) * 0.02

    def value(at):
        return np.sin(at) + 0.4 * np.cos(2.7 * at + 1.0)

    measured = value(seconds - 0.03) + rng.normal(0.0, 0.01, len(seconds))
    base = Base.flat(("offset",), np.ones((len(seconds), 1)))
    simulated = Variable("model", "N", Kind.ANY, value(seconds))
    blocks = (slice(0, len(seconds)),)
    channel = Channel(
        measured - value(seconds), "N", blocks, ("one",), (simulated,), base, time=seconds, simulated=simulated
    )
    (finding,) = [one for one in read_by_levels(settle(channel)) if one.verdict is Verdict.IDENTIFIED]
    assert finding.name == "lag of model"
    assert finding.values["delay"].value == pytest.approx(0.03, rel=0.05)


def test_a_step_and_a_pulse_are_placed_in_time(tmp_path, monkeypatch, rate_hz):
    monkeypatch.setattr(plant, "RATE_HZ", 10.0)  # edges to a third of a second
    asked = OF_TIME if rate_hz == 5.0 else ASKED
    found = found_in(tmp_path, Truth(step_um=6.0, pulse_um=12.0), asked=asked)
    stretches = sorted(rows for finding in found.there for rows in finding.rows)
    times = found.table.clock.values
    edges = np.array([[times[first], times[last]] for first, last in stretches]).ravel()
    for at in (37.5, *PULSE_S):
        assert np.abs(edges - at).min() < 0.3


def test_play_and_temperature_together(tmp_path):
    found = found_in(tmp_path, Truth(play_um=8.0, expansion_um_k=1.5))
    names = {finding.name for finding in found.there}
    assert "linear in oil_temp_c" in names
    assert names & FOUND["play"][1]
    assert len(names) == 2
    assert found.cancelling is None


def test_two_files_are_two_blocks_and_an_effect_of_one_is_placed_there(tmp_path, rate_hz):
    asked = OF_TIME if rate_hz == 5.0 else ASKED
    found = found_in(tmp_path, Truth(), Truth(pulse_um=15.0), asked=asked)
    (finding,) = found.there
    first, second = finding.blocks.values()
    assert second > 5.0 * first
    text = next(f.text for f in mismatch_result(found).findings if f.name == finding.name)
    assert "of run4.csv" in text


def test_a_parameter_with_a_derivative_is_fitted_anew_and_is_no_mismatch(tmp_path):
    found = found_in(tmp_path, Truth(stiffness_um=5.0), derivative=True)
    assert not found.there
    (offset, stiffness) = found.fitted
    assert offset.name == "offset"
    assert stiffness.name == "stiffness_um"
    assert abs(stiffness.after.value - 5.0) < 4.0 * stiffness.after.uncertainty


def test_what_a_parameter_conceals_is_said(tmp_path):
    found = found_in(tmp_path, Truth(load_by_place_um=6.0), derivative=True)
    (finding,) = found.there
    load, place = (next(v.values for v in found.table.variables if v.name == n) for n in ("load_n", "place_mm"))
    effect, parameter = load * place, load
    both = np.column_stack([np.ones(len(load)), parameter])
    left = effect - both @ np.linalg.lstsq(both, effect, rcond=None)[0]
    assert finding.confounded == pytest.approx(1.0 - np.var(left) / np.var(effect), abs=0.05)


def test_without_order_noise_is_said_to_be_fitted_jointly(tmp_path):
    recorded = record(Truth(expansion_um_k=1.5))
    del recorded.columns["t_s"]  # type: ignore[attr-defined]
    path = recorded.write(tmp_path / "x.csv")
    found = find_mismatch(load_tables([path], ASKED).table, hold_out=False)
    assert not mismatch_result(found).noise.measured_in_order
    assert any("--time rows" in step.text for step in next_measurements(found))


def test_rows_that_are_held_back_decide_nothing(tmp_path):
    path = record(Truth(play_um=8.0, expansion_um_k=1.5)).write(tmp_path / "x.csv")
    whole = load_tables([path], ASKED).table.channel(())
    whole = replace(whole, static=static_patterns(whole))
    _, rows = parts_of(whole)[2]
    other = replace(whole, residual=np.where(rows, 1.0 + np.sin(np.arange(len(rows))), whole.residual))
    chosen, anew = (chosen_again(channel.without(rows)) for channel in (whole, other))
    assert chosen.best.names == anew.best.names
    assert "linear in oil_temp_c" in chosen.best.names
    np.testing.assert_array_equal(chosen.predicted(), anew.predicted())


@pytest.mark.parametrize("name", ["twice", "product", "play"])
def test_what_a_first_list_shows_to_be_hopeless_is_never_taken_in(tmp_path, monkeypatch, name):
    monkeypatch.setattr(plant, "RATE_HZ", 10.0)  # a product shows without its linear parts
    path = record(FOUND[name][0]).write(tmp_path / "x.csv")
    channel = load_tables([path], ASKED).table.channel(())
    bank = Bank(channel)
    bank.measure()
    quick = [pattern.name for pattern in seen(bank, (), in_time=False)]
    monkeypatch.setattr(looks, "NEIGHBOUR", 0.0)
    assert [pattern.name for pattern in seen(bank, (), in_time=False)] == quick
    assert quick


@pytest.mark.slow
def test_held_out_error_is_that_of_the_noise(tmp_path):
    path = record(Truth(play_um=8.0)).write(tmp_path / "x.csv")
    error = find_mismatch(load_tables([path], ASKED).table).held_out
    assert error.before == pytest.approx(np.hypot(4e-3, 2e-3), rel=0.1)
    assert error.after == pytest.approx(2e-3, rel=0.15)


@pytest.mark.slow
def test_a_robot_measured_by_a_laser_tracker(recordings, tmp_path, rate_hz):
    """Every eighth, at night every fourth, of 2,773 poses of a UR10 [christianlandgraf/ipa-robot-accuracy, Series C], over three of its joints.

    It must predict better than once and twice q1, which are known to be there, do by least squares.
    """
    path = recordings / "real" / "robot" / "ur10-tracker.csv"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    names, *lines = path.read_text(encoding="utf-8").splitlines()
    fewer = tmp_path / "ur10.csv"
    fewer.write_text("\n".join([names, *lines[:: 8 if rate_hz == 5.0 else 4]]) + "\n", encoding="utf-8")
    asked = TableOptions("measured_mm", "model_mm", {"q1": None, "q2": None, "q3": None})
    found = find_mismatch(load_tables([fewer], asked).table)
    q1 = np.radians(found.table.columns["q1"])
    known = [np.ones(len(q1)), np.cos(q1), np.sin(q1), np.cos(2.0 * q1), np.sin(2.0 * q1)]
    assert found.held_out.as_simulated == pytest.approx(predicted_rms(found, known[:1]), rel=1e-9)
    assert found.held_out.after < predicted_rms(found, known) < 0.6 * found.held_out.as_simulated
    assert not found.is_worse
    assert max(found.levels.follows, key=lambda one: one.rms).variables[0][0] == "q1"
    assert any("q1" in finding.variables for finding in found.identified)
    follows = [one for one in found.levels.follows if one.answer is FollowsAnswer.FOLLOWS]
    assert all(one.gain > np.log(19.0) and one.after < one.before for one in follows)
    assert {name for one in follows for name in one.members} >= {one.name for one in found.identified}


def predicted_rms(found: Mismatch, columns: list) -> float:
    """Error of ten held-out parts that columns leave, fitted to the others by least squares."""
    residual, columns = found.settled.channel.residual, np.column_stack(columns)
    square = 0.0
    for _, rows in parts_of(found.settled.channel):
        values, *_ = np.linalg.lstsq(columns[~rows], residual[~rows], rcond=None)
        square += float(np.sum((residual - columns @ values)[rows] ** 2))
    return float(np.sqrt(square / len(residual)))


def test_effects_that_cancel_each_other_are_said():
    t = np.linspace(0.0, 1.0, 300)
    one, other = np.sin(9.0 * t), np.sin(9.0 * t) + 0.1 * np.cos(31.0 * t)
    difference = 10.0 * one - 9.9 * other + 0.001 * np.random.default_rng(5).standard_normal(300)
    axis = Variable("place", "mm", Kind.LENGTH, t)
    table = Table(
        measured=difference,
        simulated=np.zeros(300),
        unit="mm",
        simulated_name="simulated",
        variables=(axis,),
        derivatives={"a": one, "b": other},
        columns={},
        blocks=(slice(0, 300),),
        names=("run",),
        clock=None,
        free=frozenset({"a", "b"}),
    )
    found = find_mismatch(table, hold_out=False)
    assert found.cancelling.rms == pytest.approx({"a": 10.0 * np.std(one), "b": 9.9 * np.std(other)}, rel=0.01)
    assert found.cancelling.rms_of_sum == pytest.approx(np.std(10.0 * one - 9.9 * other), rel=0.01)
    assert mismatch_result(found).cancelling.rms_of_sum == found.cancelling.rms_of_sum


def test_uncertainties_are_not_less_than_those_of_parts_that_differ():
    rng = np.random.default_rng(8)
    rows = np.arange(600)
    warm = np.tile(np.linspace(-1.0, 1.0, 60), 10)
    slopes = 1.0 + 0.3 * rng.standard_normal(10)
    residual = np.repeat(slopes, 60) * warm + 0.05 * rng.standard_normal(600)
    variables = (Variable("warm", "degC", Kind.TEMPERATURE, warm),)
    channel = Channel(residual, "mm", (slice(0, 600),), ("run",), variables, Base.flat(("offset",), np.ones((600, 1))))
    settled = settle(channel, look=False)
    refits = refits_without(settled, [rows // 60 == k for k in range(10)])
    plain, told = (
        next(one for one in read_by_levels(settled, trial) if one.name == "linear in warm").values["slope"]
        for trial in (Trial(), Trial(refits=refits))
    )
    # Ten slopes that differ, each known to a hundredth, say their mean to a root of ten less than their spread.
    assert told.uncertainty == pytest.approx(np.std(slopes, ddof=1) / np.sqrt(10.0), rel=0.1)
    assert plain.uncertainty < 0.3 * told.uncertainty
    assert told.value == plain.value


def test_the_printed_product_can_be_put_into_a_simulation(tmp_path):
    """Coefficient and zeros as people read them leave nothing of the product in the table."""
    tables = load_tables([record(FOUND["product"][0]).write(tmp_path / "x.csv")], ASKED).table
    result = mismatch_result(find_mismatch(tables, hold_out=False))
    found = next(one for one in result.findings if one.name in FOUND["product"][1])
    places = re.findall(r"(\w+) (-?[\d.e+]+)", re.search(r"zero at (.*?)\. ", found.text + " ")[1])
    values = {v.name: v.values for v in tables.variables}
    away = [values[name] - float(zero) for name, zero in places if name in values]
    assert len(away) == 2
    left = tables.measured - tables.simulated - found.values["coefficient"].value * away[0] * away[1]
    term = np.prod([column - column.mean() for column in away], axis=0)
    design = np.column_stack([term, *away, np.ones(len(term))])
    covariance = np.linalg.inv(design.T @ design)
    coefficient = (covariance @ design.T @ left)[0]
    u = np.sqrt(covariance[0, 0]) * np.std(left - design @ np.linalg.lstsq(design, left)[0])
    assert abs(coefficient) < 3.0 * np.hypot(u, found.values["coefficient"].uncertainty)
