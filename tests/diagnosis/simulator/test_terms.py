"""Terms at ports against closed forms, and against what an integrator needs of them."""

import numpy as np
import pytest
from scipy.interpolate import BSpline, make_lsq_spline

from dbbstation.diagnosis.simulator.terms import Term, TermForm, bends, evaluator

T = np.linspace(0.0, 4.0, 4001)
X = np.sin(3.0 * T)


def over(term, t=T, x=X):
    value = evaluator(term)
    return np.array([value(at, {"x": signal}) for at, signal in zip(t.tolist(), x.tolist(), strict=True)])


def term(form, amplitudes=(2.0,), shape=(), fixed=()):
    return Term("p", form, ("x",), amplitudes, shape, fixed)


@pytest.mark.parametrize(
    ("form", "shape", "fixed", "expected"),
    [
        (TermForm.LINEAR, (), (), 2.0 * X),
        (TermForm.SQUARE, (), (), 2.0 * X**2),
        (TermForm.DRAG, (), (), 2.0 * X * np.abs(X)),
        (TermForm.CUBIC, (), (), 2.0 * X**3),
        (TermForm.SIGN, (0.1,), (), 2.0 * X / np.hypot(X, 0.1)),
        (TermForm.HINGE, (0.3,), (), 2.0 * np.maximum(X - 0.3, 0.0)),
        (TermForm.LIMIT, (0.3,), (), 2.0 * np.clip(X, -0.3, 0.3)),
    ],
)
def test_a_form_is_its_formula(form, shape, fixed, expected):
    np.testing.assert_allclose(over(term(form, shape=shape, fixed=fixed)), expected, rtol=1e-12, atol=1e-15)


def test_a_turn_is_a_cosine_and_a_sine():
    found = over(term(TermForm.PERIODIC, (2.0, 3.0), fixed=(2.0 * np.pi, 2.0)))
    np.testing.assert_allclose(found, 2.0 * np.cos(2.0 * X) + 3.0 * np.sin(2.0 * X), atol=1e-12)


def test_a_lag_follows_a_sine_as_its_transfer_function_says():
    tau, w = 0.2, 3.0
    gain, phase = 1.0 / np.hypot(1.0, w * tau), np.arctan(w * tau)
    steady = 10.0 * tau < T
    expected = gain * np.sin(w * T - phase)
    np.testing.assert_allclose((X + over(term(TermForm.LAG, (tau,))))[steady], expected[steady], atol=1e-4)
    np.testing.assert_allclose(over(term(TermForm.MEMORY, (5.0,), (tau,)))[steady], 5.0 * expected[steady], atol=5e-4)


def test_a_dead_time_is_the_signal_a_while_ago():
    found = X + over(term(TermForm.DELAY, (0.25,)))
    late = T >= 0.25
    np.testing.assert_allclose(found[late], np.sin(3.0 * (T[late] - 0.25)), atol=2e-6)
    np.testing.assert_allclose(found[~late], X[0])


def test_a_play_takes_its_half_width_off_at_each_reversal():
    half = 0.2
    found = X + over(term(TermForm.PLAY, (half,)))
    turns = np.flatnonzero(np.diff(np.sign(np.diff(X)))) + 1
    for k in turns:
        assert found[k] == pytest.approx(X[k] - half * np.sign(X[k]), abs=1e-6)
    assert np.all(np.abs(found - X) <= half + 1e-12)


def test_stick_slip_is_a_spring_until_it_slides():
    found = over(term(TermForm.SLIP, (3.0,), (0.1,)))
    rising = T < 0.02
    np.testing.assert_allclose(found[rising], 3.0 * X[rising] / 0.1, atol=1e-9)
    assert found.max() == pytest.approx(3.0)
    assert found.min() == pytest.approx(-3.0)


def test_a_curve_is_the_spline_of_its_knots():
    knots = np.array([-1.1] * 4 + [-0.3, 0.4] + [1.1] * 4)
    values = np.array([0.1, -0.5, 0.3, 0.7])
    found = over(term(TermForm.CURVE, tuple(values), fixed=tuple(knots)))
    np.testing.assert_allclose(found, BSpline(knots, bends(knots) @ values, 3)(X), atol=1e-5)


def test_a_curve_has_no_straight_line_in_it_but_any_parabola():
    knots = np.array([-1.1] * 4 + [-0.3, 0.4] + [1.1] * 4)
    line = make_lsq_spline(np.linspace(-1.1, 1.1, 99), 3.0 + 2.0 * np.linspace(-1.1, 1.1, 99), knots).c
    np.testing.assert_allclose(bends(knots).T @ line, 0.0, atol=1e-9)
    x = np.linspace(-1.1, 1.1, 99)
    every = np.column_stack([BSpline(knots, bends(knots)[:, k], 3)(x) for k in range(4)] + [np.ones(99), x])
    left = x**2 - every @ np.linalg.lstsq(every, x**2, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-9)


@pytest.mark.parametrize("form", [TermForm.LAG, TermForm.MEMORY, TermForm.PLAY, TermForm.SLIP, TermForm.DELAY])
def test_steps_that_a_solver_takes_back_change_nothing(form):
    shape = (0.2,) if form in {TermForm.MEMORY, TermForm.SLIP} else ()
    once = over(term(form, (0.2,), shape))
    value, found = evaluator(term(form, (0.2,), shape)), []
    for k, (at, signal) in enumerate(zip(T.tolist(), X.tolist(), strict=True)):
        value(at + 0.0005, {"x": 5.0})  # tried, and given up
        if k > 3:
            value(T[k - 2], {"x": X[k - 2]})
            value(T[k - 1], {"x": X[k - 1]})
        found.append(value(at, {"x": signal}))
    np.testing.assert_allclose(found, once, atol=1e-12)


def test_a_term_that_puts_something_in_place_of_a_signal_does_nothing_at_zero():
    for form in (TermForm.LAG, TermForm.DELAY, TermForm.PLAY):
        assert not over(term(form, (0.0,))).any()
