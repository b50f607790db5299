"""Lags and dead times as laws: against a differential equation solved finely, and what is said of tables that lack one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.bank import Bank
from dbbstation.inference.bent import LawRows, memory_laws
from dbbstation.inference.channel import Base, Channel, Kind, Law, Variable
from dbbstation.inference.coloured import Coloured
from dbbstation.inference.levels import Verdict
from dbbstation.inference.model_comparison import Member
from dbbstation.inference.read_off import growth, moved
from dbbstation.laws.memory import lagging
from tests.diagnosis.table.nulls import moving, table_of

NOISE_MM = 0.02


@pytest.mark.parametrize("constant", [0.03, 0.4, 5.0])
def test_a_lag_is_that_of_its_differential_equation(rng, constant):
    time = np.cumsum(rng.uniform(0.05, 0.2, 120))
    values = np.cumsum(rng.standard_normal(120))
    late = values + lagging(values, time, constant)
    solved = solve_ivp(
        lambda t, y: (np.interp(t, time, values) - y) / constant,
        (time[0], time[-1]),
        values[:1],
        t_eval=time,
        rtol=1e-9,
        atol=1e-10,
        max_step=0.01,
    )
    assert late == pytest.approx(solved.y[0], abs=1e-5)


def test_each_block_begins_by_itself():
    time = np.tile(np.arange(50.0), 2)
    values = np.concatenate([np.sin(time[:50] / 9.0), 5.0 + np.sin(time[50:] / 9.0)])
    blocks = (slice(0, 50), slice(50, 100))
    (memory, dead) = memory_laws(LawRows(time, "s", blocks, 1.0, "mm"), [Variable("x", "mm", Kind.LENGTH, values)])
    both = memory.columns((4.0,))
    alone = memory_laws(
        LawRows(time[50:], "s", blocks[:1], 1.0, "mm"), [Variable("x", "mm", Kind.LENGTH, values[50:])]
    )[0]
    assert both[50:, 1] == pytest.approx(alone.columns((4.0,))[:, 1], abs=1e-12)
    # A dead time of three rows is a shift by three rows.
    shifted = dead.columns((3.0,))[:, 1] + values
    assert shifted[3:50] == pytest.approx(values[:47], abs=1e-12)
    assert shifted[53:] == pytest.approx(values[50:97], abs=1e-12)
    assert shifted[50] == values[50]


def test_many_runs_begin_alike():
    time = np.tile(np.arange(40.0), 7)
    values = np.sin(np.tile(np.arange(40.0), 7) / 9.0)
    blocks = tuple(slice(40 * k, 40 * k + 40) for k in range(7))
    memory = memory_laws(LawRows(time, "s", blocks, 1.0, "mm"), [Variable("x", "mm", Kind.LENGTH, values)])[0]
    columns = memory.columns((4.0,))
    assert columns.shape == (280, 3)
    assert columns[:, 2] == pytest.approx(np.tile(np.exp(-np.arange(40.0) / 4.0), 7))
    assert len(memory.plausible) == 3


def test_what_stands_still_or_jumps_has_no_memory(rng):
    time = np.arange(60.0)
    poses = Variable("pose", "mm", Kind.LENGTH, rng.uniform(0.0, 100.0, 60))
    clock = Variable("t_s", "s", Kind.TIME, time)
    assert memory_laws(LawRows(time, "s", (slice(0, 60),), 1.0, "mm"), [poses, clock]) == []


def _late(values, time, constant):
    """Euler's method in a hundredth of a row: another way to the same."""
    state, found = values[0], [values[0]]
    for k in range(1, len(values)):
        for j in range(100):
            now = values[k - 1] + (values[k] - values[k - 1]) * (j + 0.5) / 100.0
            state += (now - state) * (time[k] - time[k - 1]) / 100.0 / constant
        found.append(state)
    return np.array(found)


def _told(seed, effect_of, size):
    rng = np.random.default_rng([seed, 77])
    axis = moving(rng, 500)
    effect, parameters = effect_of(axis)
    effect = effect - effect.mean()
    gain = size * NOISE_MM / np.std(effect)
    simulated = axis.place + 0.1 * axis.load
    measured = simulated + gain * effect + NOISE_MM * rng.standard_normal(500)
    found = find_mismatch(table_of(axis, measured, simulated), hold_out=False)
    return found, gain, parameters


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, pytest.param(3, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("at_once", [False, True], ids=["lacking", "at once"])
def test_a_first_order_memory_is_named_with_its_time_constant(seed, at_once):
    def creeping(axis):
        constant = float(axis.t[-1]) / 18.0
        return _late(axis.load, axis.t, constant) - at_once * axis.load, constant

    found, gain, constant = _told(seed, creeping, 3.0)
    finding = next(one for one in found.findings if one.name == "memory of load_n")
    assert finding.verdict is Verdict.IDENTIFIED
    assert finding.label.endswith("at once" if at_once else "lacks")
    for name, true in (("gain", gain), ("time constant", constant)):
        value = finding.values[name]
        assert abs(value.value - true) < 3.0 * value.uncertainty
        assert value.uncertainty < 0.2 * true
    assert {one.name for one in found.there if one.form != "wave"} == {"memory of load_n"}


@pytest.mark.slow
def test_a_dead_time_of_some_rows_is_one_of_what_comes_late():
    def delayed(axis):
        delay = 12.0 * float(axis.t[1])
        simulated = axis.place + 0.1 * axis.load
        return np.interp(axis.t - delay, axis.t, simulated) - simulated, delay

    found, _, delay = _told(2, delayed, 20.0)
    finding = next(one for one in found.findings if one.name == "dead time of simulated_mm")
    assert finding.verdict in {Verdict.IDENTIFIED, Verdict.AMBIGUOUS}
    value = finding.values["dead time"]
    assert abs(value.value - delay) < 3.0 * value.uncertainty


@pytest.mark.parametrize("rows_late", [11, *(pytest.param(rows, marks=pytest.mark.nightly) for rows in (5, 23))])
def test_a_dead_time_of_a_variable_that_jumps_is_found_to_a_fraction_of_a_row(rng, rows_late):
    # Tangents end at the next row: what jumps changes by a whole jump there.
    jumps = np.zeros(600)
    jumps[rng.choice(np.arange(30, 590), 24, replace=False)] = rng.normal(0.0, 30.0, 24)
    valve = Variable("valve", "percent", Kind.ANY, np.cumsum(jumps))
    time = Variable("t_s", "s", Kind.TIME, 0.05 * np.arange(600))
    late = np.concatenate([np.full(rows_late, valve.values[0]), valve.values[:-rows_late]])
    effect = 0.01 * (late - valve.values)
    measured = effect + 0.2 * np.std(effect) * rng.standard_normal(600)
    table = Table(
        measured=measured,
        simulated=np.zeros(600),
        unit="mm",
        simulated_name="simulated_mm",
        variables=(time, valve),
        derivatives={},
        columns={},
        blocks=(slice(0, 600),),
        names=("run",),
        clock=time,
    )
    found = find_mismatch(table, hold_out=False)
    (finding,) = (one for one in found.there if one.name == "dead time of valve")
    value = finding.values["dead time"]
    assert abs(value.value - 0.05 * rows_late) < 3.0 * value.uncertainty
    assert value.uncertainty < 0.02
    assert {one.name for one in found.there} == {"dead time of valve"}


def test_a_step_along_a_tangent_counts_in_the_amplitudes_that_it_was_made_for(rng):
    # Of a law that was laid out at a sixth of its amplitude: exp(-t / tau), whose effect is known in closed form.
    time = np.linspace(0.0, 5.0, 400)
    law = Law(
        name="fading",
        columns=lambda point: np.exp(-time / point[0])[:, None],
        plausible=np.array([1.0]),
        parameters=("amplitude", "time constant"),
        units=("mm", "s"),
        grids=((0.5, 1.0, 2.0),),
    )
    residual = 6.0 * np.exp(-time / 1.1) + 1e-3 * rng.standard_normal(400)
    base = Base.flat(("offset",), np.ones((400, 1)))
    bank = Bank(Channel(residual, "mm", (slice(0, 400),), ("run",), (), base, laws=(law,)))
    bank.noise = Coloured(1e-3)
    bank.refine("fading", (1.05,), np.array([1.0]))
    (cause,) = bank.causes
    member = Member(cause, cause.variants[0], scale=6.0, slack_scale=6.0)
    values = bank.beside().comparison(bank.target).values([member])
    assert growth(member, values) == pytest.approx(6.0, rel=0.02)
    # What is left is of second order in the step: 0.05 squared over the time constant.
    assert moved(law, member, values, growth(member, values))[0] == pytest.approx(1.1, abs=0.005)
