"""Laws that a signal bends, against closed forms and a differential equation; and tables that lack one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from dbbstation.inference.bent import LawRows, bent_laws, grows_with, integral_of, memory_laws
from dbbstation.inference.channel import Kind, Variable, beyond_reach
from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels_of import levels_of
from dbbstation.inference.patterns import Family
from dbbstation.inference.read_off import named_values
from dbbstation.inference.settle import Beginning, settle
from tests.diagnosis.table.domains import answer
from tests.inference.tables import direction, table
from tests.inference.test_channel import channel

ONE = (Beginning.EVERYTHING,)


def laws_of(data):
    """New laws of a table, beside lags and dead times, by name."""
    whole = channel(data, blocks=1)
    variables, blocks = whole.variables, whole.blocks
    rows = LawRows(data.t, "s", blocks, 0.2, "mm")
    return {law.name: law for law in (*bent_laws(rows, variables, {}), *memory_laws(rows, variables))}


def test_columns_are_their_formulas():
    data = table(1, rows=400)
    laws = laws_of(data)
    rate = np.gradient(data.q, data.t)
    expected = {
        ("saturation of q", 7.0): np.tanh(data.q / 7.0),
        ("dead zone of q", 7.0): np.where(np.abs(data.q) > 7.0, data.q - 7.0 * np.sign(data.q), 0.0),
        ("friction of q", 2.5): np.tanh(rate / 2.5),
        ("upper knee of q", 7.0): np.where(data.q > 7.0, data.q - 7.0, 0.0),
        ("lower knee of q", 7.0): np.where(data.q < 7.0, data.q - 7.0, 0.0),
        ("saturation of temperature", 0.5): np.tanh(
            (data.temperature - 0.5 * (data.temperature.min() + data.temperature.max())) / 0.5
        ),
    }
    for (name, width), values in expected.items():
        assert laws[name].columns((width,))[:, 0] == pytest.approx(values, abs=1e-12)
    scaled = laws["scaled hysteresis of q by load"].columns(())
    assert scaled[2:-2, 0] == pytest.approx((np.sign(rate) * data.load)[2:-2], abs=1e-12)
    assert not any("by t" in name.split() or name.endswith(" of t") for name in laws)


def test_the_integral_of_a_sine_is_a_cosine():
    time = np.linspace(0.0, 6.0 * np.pi, 2001)
    wave = Variable("x", "A", Kind.ANY, np.sin(time))
    found = integral_of(wave.values, time, (slice(0, 2001),))
    assert found == pytest.approx(1.0 - np.cos(time), abs=2e-5)
    # Each run begins at zero again.
    both = integral_of(wave.values, time, (slice(0, 1000), slice(1000, 2001)))
    assert both[1000] == 0.0
    assert both[1000:] == pytest.approx(found[1000:] - found[1000], abs=1e-12)


def test_rows_without_order_have_no_direction_and_no_past():
    data = table(1, rows=200)
    variables = channel(data, blocks=1).variables
    found = bent_laws(LawRows(None, "s", (slice(0, 200),), 0.2, "mm"), variables, {})
    assert {law.family for law in found} == {Family.SATURATION, Family.DEAD_ZONE, Family.KNEE}


MISSING = {
    "saturation of q": (lambda d: 0.3 * np.tanh(d.q / 12.0), {"turns over within": 12.0, "limit": 0.3}),
    "friction of q": (lambda d: 0.3 * np.tanh(np.gradient(d.q, d.t) / 6.0), {"turns over within": 6.0, "size": 0.3}),
    "scaled hysteresis of q by load": (lambda d: 0.08 * direction(d.q) * d.load, {"size per unit": 0.08}),
    "integral of q": (
        lambda d: 0.005 * np.concatenate([[0.0], np.cumsum(0.5 * (d.q[1:] + d.q[:-1]) * np.diff(d.t))]),
        {"rate": 0.005, "zero": 0.0},
    ),
    "integral of temperature": (
        lambda d: 0.05 * integral_of(d.temperature - 21.0, d.t, (slice(0, len(d.t)),)),
        {"rate": 0.05, "zero": 21.0},
    ),
    "upper knee of q": (lambda d: -0.05 * np.maximum(d.q - 9.0, 0.0), {"slope beyond": -0.05, "knee": 9.0}),
}


@pytest.mark.parametrize("name", MISSING)
def test_a_table_that_lacks_one_names_it_with_its_numbers(name):
    effect, numbers = MISSING[name]
    data = table(5, effect, rows=700)
    settled = settle(
        replace(channel(data, blocks=1), laws=tuple(laws_of(data).values())), beginnings=ONE, thorough=False
    )
    levels = levels_of(settled, left_over(settled), None)
    named = {law for one in levels.follows for law in (one.form.names if one.form else ())}
    assert name in named
    member = next(m for m in settled.best.members if m.cause.name == name)
    estimates = settled.comparison.estimates([member, *settled.best.without(name)])
    width = len(member.columns)
    values = named_values(settled, member, estimates.values[:width], estimates.covariance[:width, :width])
    for number, true in numbers.items():
        assert abs(values[number].value - true) < 4.0 * values[number].uncertainty + 0.02 * abs(true)


def test_a_simulated_straight_line_tells_a_dead_zone_from_a_limit():
    """Measured is flat within 7 where the simulation goes straight on, or beyond it: the difference has the other form."""
    data = table(1, rows=400)
    variables, rows = channel(data, blocks=1).variables, LawRows(data.t, "s", (slice(0, 400),), 0.2, "mm")
    within = np.clip(data.q, -7.0, 7.0)
    for slope in (2.0, -2.0):
        simulated = slope * data.q + 0.3 * data.load
        grows = grows_with(variables, simulated, 0.2)
        laws = {law.name: law for law in bent_laws(rows, variables, grows)}
        for name, measured in (("dead zone of q", slope * (data.q - within)), ("saturation of q", slope * within)):
            law = laws[name]
            columns = law.columns((7.0,))
            amplitudes = [float(c @ (measured - slope * data.q) / (c @ c)) for c in columns.T]
            left = [
                np.abs(a * c - (measured - slope * data.q)).max() for a, c in zip(amplitudes, columns.T, strict=True)
            ]
            assert min(left) < 1e-12
            assert amplitudes[int(np.argmin(left))] == pytest.approx(abs(slope))
            assert all(law.positive)
    # What the simulation does not have in a straight line has no sign.
    grows = grows_with(variables, np.cos(data.t), 0.2)
    laws = {law.name: law for law in bent_laws(rows, variables, grows)}
    assert not laws["dead zone of q"].positive


def test_u_of_a_width_is_that_of_least_squares():
    data = table(5, lambda d: 0.3 * np.tanh(d.q / 12.0), rows=700)
    whole = replace(channel(data, blocks=1), laws=(laws_of(data)["saturation of q"],))
    settled = settle(whole, beginnings=ONE, thorough=False)
    (member,) = settled.best.members
    estimates = settled.comparison.estimates([member])
    value = named_values(settled, member, estimates.values, estimates.covariance)["turns over within"]
    base = whole.base.samples

    def left(p):
        return whole.residual - base @ p[2:] - p[0] * np.tanh(data.q / p[1])

    fitted = least_squares(left, [0.3, 12.0, *np.zeros(base.shape[1])])
    covariance = np.linalg.inv(fitted.jac.T @ fitted.jac) * 2.0 * fitted.cost / (len(data.q) - len(fitted.x))
    assert value.value == pytest.approx(fitted.x[1], abs=0.5 * value.uncertainty)
    assert value.uncertainty == pytest.approx(np.sqrt(covariance[1, 1]), rel=0.2)


def test_an_effect_many_times_the_difference_is_refused():
    """An integral, and a wave over time that cancels it but for a lag: what is left of a thousandfold is no law."""
    law = laws_of(table(1, rows=300))["integral of q"]
    assert not beyond_reach(law, 4.0 * law.reach)
    assert "14 times the difference" in beyond_reach(law, 14.0 * law.reach)
    assert not beyond_reach(replace(law, family=None), 14.0 * law.reach)


def test_a_law_laid_out_in_one_place_may_be_taken_in_another():
    """A magnet's saturation, whose straight line was named before, so that 18 % of the effect were left."""
    found = answer("magnet", 101, "effect")
    assert found["laws"] == ["saturation of coil_a"]
    assert found["left"] < 0.1
