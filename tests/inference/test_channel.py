"""The channel finds what a simulated table holds, says how large it is, and claims nothing where there is nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.inference.channel import Base, Channel, Kind, Law, Variable
from dbbstation.inference.coloured import Coloured
from dbbstation.inference.folds import held_out_error, selections_without
from dbbstation.inference.levels import Verdict
from dbbstation.inference.model_comparison import Cause, Member, ModelComparison, Variant
from dbbstation.inference.read_off import CauseFinding
from dbbstation.inference.settle import settle
from tests.inference import tables
from tests.inference.reading import read_by_levels
from tests.inference.tables import Table, direction, table

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

EFFECTS: dict[str, Callable[[Table], NDArray[np.float64]]] = {
    "hysteresis of q": lambda d: 0.15 * direction(d.q),
    "twice per turn of angle": lambda d: 0.1 * np.cos(2.0 * np.radians(d.angle) + 0.5),
    "once per turn of angle": lambda d: 0.1 * np.cos(np.radians(d.angle) - 1.0),
    "product of q and load": lambda d: 0.15 * d.q * d.load / 150.0,
    "linear in q": lambda d: 0.003 * d.q,
    "lag of simulated": lambda d: -0.05 * np.gradient(d.simulated, d.t),
    "linear in temperature": lambda d: 0.15 * (d.temperature - 20.0),
    "drift with t": lambda d: 0.005 * d.t,
}


def channel(data: Table, laws: tuple[Law, ...] = (), blocks: int = 2) -> Channel:
    rows = len(data.t)
    return Channel(
        residual=data.residual,
        unit="mm",
        blocks=tuple(slice(k * rows // blocks, (k + 1) * rows // blocks) for k in range(blocks)),
        names=tuple(f"run {k + 1}" for k in range(blocks)),
        variables=(
            Variable("t", "s", Kind.TIME, data.t),
            Variable("q", "mm", Kind.LENGTH, data.q),
            Variable("angle", "deg", Kind.ANGLE, data.angle, 360.0),
            Variable("load", "N", Kind.FORCE, data.load),
            Variable("temperature", "degC", Kind.TEMPERATURE, data.temperature),
        ),
        base=Base.flat(("offset",), np.ones((rows, 1))),
        laws=laws,
        time=data.t,
        simulated=Variable("simulated", "mm", Kind.LENGTH, data.simulated),
    )


def of_time(data: Table, blocks: int = 2) -> Channel:
    """The channel over time and one place, for what happens in time."""
    whole = channel(data, blocks=blocks)
    return replace(whole, variables=whole.variables[:2])


@pytest.fixture(autouse=True)
def fewer_rows(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of the rows; the nightly tests have all."""
    if "not nightly" in request.config.option.markexpr:
        monkeypatch.setattr(tables, "ROWS", 500)


def half() -> int:
    """Half the rows, in which the noise is known to 6 % and a temperature that rises is no line over time."""
    return max(tables.ROWS, 750)


@cache
def alone(name: str, seed: int) -> dict[str, CauseFinding]:
    """What is there in a table with one effect: its name is asked for, and its size."""
    rows = half() if name == "linear in temperature" else None
    return there(read_by_levels(settle(channel(table(seed, EFFECTS[name], rows=rows)))))


def there(findings: tuple[CauseFinding, ...]) -> dict[str, CauseFinding]:
    return {finding.name: finding for finding in findings if finding.verdict in {Verdict.IDENTIFIED, Verdict.HAPPENED}}


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (1, 2, 3))])
def test_nothing_is_claimed_of_white_noise(seed: int) -> None:
    settled = settle(channel(table(seed, rows=half())))
    assert not there(read_by_levels(settled))
    assert settled.noise.sigma == pytest.approx(0.1, rel=0.06)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (1, 2, 3))])
def test_nothing_is_claimed_of_noise_whose_neighbours_resemble_each_other(seed: int) -> None:
    settled = settle(channel(table(seed, correlation=0.9)))
    assert not there(read_by_levels(settled))
    # A first-order process of 0.9 counts as one independent row in 19 [(1 + 0.9) / (1 - 0.9)].
    assert settled.noise.correlation_samples == pytest.approx(19.0, rel=0.5)


def test_a_bell_over_one_place_is_found_there_with_its_rows() -> None:
    data = table(3)
    bell = 0.6 * np.exp(-0.5 * ((data.q - 40.0) / 6.0) ** 2)
    found = there(read_by_levels(settle(channel(replace(data, residual=data.residual + bell)))))
    ((name, finding),) = found.items()
    assert name.startswith("bump over q")
    (span,) = finding.spans
    # A bell of 6 mm is half as high 7.1 mm away; the form that is laid over it is a quarter wider or narrower at the most.
    assert (span.low, span.high) == pytest.approx((40.0 - 7.1, 40.0 + 7.1), abs=2.0)
    assert finding.rows_there == int(((data.q >= span.low) & (data.q <= span.high)).sum())


def test_whitening_makes_noise_white_that_is_as_it_says() -> None:
    noise = Coloured.first_order(2.0, share=0.8, decay=0.9)
    lags = np.arange(200)
    apart = np.abs(lags[:, None] - lags)
    covariance = 4.0 * np.where(apart == 0, 1.0, 0.8 * 0.9**apart)
    whitening = noise.whitening([slice(0, 120), slice(120, 200)])
    assert whitening is not None
    for block in (slice(0, 120), slice(120, 200)):
        white = (whitening @ np.eye(200))[block, block]
        found = white @ covariance[block, block] @ white.T / noise.innovation**2
        assert np.abs(found - np.eye(len(found))).max() < 0.01


@pytest.mark.parametrize("seeds", [1, pytest.param(4, marks=pytest.mark.nightly)])
def test_an_effect_is_found_in_correlated_noise_with_an_honest_size(seeds: int) -> None:
    away = []
    for seed in range(seeds):
        data = table(seed, EFFECTS["linear in temperature"], correlation=0.9, rows=half())
        found = there(read_by_levels(settle(channel(data))))
        value = found["linear in temperature"].values["slope"]
        away.append((value.value - 0.15) / value.uncertainty)
    assert np.abs(away).max() < 3.6


@pytest.mark.parametrize("correlation", [pytest.param(0.0, marks=pytest.mark.nightly), 0.9])
def test_a_pulse_is_found_without_being_told_when(correlation: float) -> None:
    data = table(8, lambda d: 0.4 * ((d.t >= 20.0) & (d.t < 23.0)), correlation=correlation)
    (found,) = there(read_by_levels(settle(of_time(data)))).values()
    (rows,) = found.rows
    # A row in or out of it costs little where its noise is a quarter of the pulse.
    assert abs(rows[0] - 400) <= 2
    assert abs(rows[1] - 459) <= 2
    assert next(iter(found.values.values())).value == pytest.approx(0.4, abs=0.1)


def test_several_pulses_are_found() -> None:
    starts = (100, 333, 512, 800, 1300)

    def pulses(d: Table) -> NDArray[np.float64]:
        row = np.arange(len(d.t))
        return 0.3 * np.sum([(row >= k) & (row < k + 40) for k in starts], axis=0)

    found = there(read_by_levels(settle(of_time(table(9, pulses, rows=1500))))).values()
    assert {finding.form for finding in found} == {"pulses"}
    rows = sorted(stretch for finding in found for stretch in finding.rows)
    assert len(rows) == len(starts)
    assert np.abs(np.array([first for first, _ in rows]) - starts).max() <= 3


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_found_by_its_form_alone(name: str) -> None:
    assert set(alone(name, 11)) == {name}


@pytest.mark.parametrize("seeds", [(11,), pytest.param((0, 1, 2), marks=pytest.mark.nightly)])
def test_sizes_lie_within_their_uncertainty(seeds: tuple[int, ...]) -> None:
    truth = {"linear in temperature": 0.15, "drift with t": 0.005, "linear in q": 0.003, "lag of simulated": 0.05}
    away = []
    for name, true in truth.items():
        for seed in seeds:
            value = next(iter(alone(name, seed)[name].values.values()))
            away.append((value.value - true) / value.uncertainty)
    # Twelve standard normal numbers: one beyond 3.6 once in 260 times, their root mean square beyond 1.7 once in 2,000; of four numbers
    # once in 47.
    assert np.abs(away).max() < 3.6
    assert np.sqrt(np.mean(np.square(away))) < 1.7


def test_a_wave_is_found_with_its_period() -> None:
    found = there(read_by_levels(settle(channel(table(3, lambda d: 0.1 * np.sin(2.0 * np.pi * d.q / 7.3))))))
    (wave,) = [finding for finding in found.values() if finding.form == "wave"]
    assert wave.variables == ("q",)
    assert float(wave.name.split("period ")[1].split()[0]) == pytest.approx(7.3, rel=0.01)
    assert float(np.hypot(*(v.value for v in wave.values.values()))) == pytest.approx(0.1, abs=0.02)


def test_a_law_with_a_nonlinear_parameter_is_refined_between_the_points_of_its_grid() -> None:
    data = table(5, lambda d: 0.3 * (1.0 - np.exp(-d.t / 17.0)))
    law = Law(
        "warm-up",
        lambda point: (1.0 - np.exp(-data.t / point[0]))[:, None],
        np.array([0.2]),
        ("size", "time constant"),
        ("mm", "s"),
        ((5.0, 10.0, 20.0, 40.0),),
    )
    (found,) = there(read_by_levels(settle(channel(data, (law,))))).values()
    assert found.name == "warm-up"
    constant = found.values["time constant"]
    assert abs(constant.value - 17.0) < 4.0 * constant.uncertainty
    assert constant.uncertainty < 3.0


def test_a_law_that_would_have_to_be_negative_is_refused() -> None:
    data = table(6, lambda d: -0.2 * d.load / 5.0)
    law = Law("weight", lambda _: (data.load / 5.0)[:, None], np.array([0.2]), ("weight",), ("mm",), positive=(True,))
    findings = {finding.name: finding for finding in read_by_levels(settle(channel(data, (law,))))}
    assert findings["weight"].verdict is Verdict.RULED_OUT
    assert "negative" in findings["weight"].text


@pytest.mark.nightly  # that of a table is in CI: tests/diagnosis/table/test_mismatch.py
def test_held_out_error_comes_down_to_the_noise() -> None:
    data = channel(table(2, EFFECTS["hysteresis of q"]))
    error = held_out_error(data, selections_without(data, settle))
    assert len(error.folds) == 10
    assert error.before == pytest.approx(np.hypot(0.15, 0.1), rel=0.06)
    assert error.after == pytest.approx(0.1, rel=0.08)


def test_all_members_at_once_are_what_each_is_beside_the_others() -> None:
    rng = np.random.default_rng(4)
    columns = rng.standard_normal((200, 9)) @ rng.standard_normal((9, 9))
    target = columns @ rng.standard_normal(9) + rng.standard_normal(200)
    comparison = ModelComparison(columns.T @ columns, columns.T @ target)
    members = [
        Member(Cause(f"{k}", (variant,), -1.0), variant, scale)
        for k, (variant, scale) in enumerate(
            (Variant(np.arange(3 * k, 3 * k + 3), np.full(3, 0.5)), scale) for k, scale in enumerate((0.3, 1.0, 3.0))
        )
    ]
    for k, (found, averaged, best) in enumerate(comparison.each_beside_others(members)):
        scan = comparison.scan([m for m in members if m is not members[k]], [members[k].cause])
        assert averaged == pytest.approx(scan.log_factor[0], rel=1e-9)
        assert best == pytest.approx(scan.log_best[0], rel=1e-9)
        assert found.scale == scan.best[0].scale
        assert comparison.each_beside_others(members, [k])[0][1:] == (averaged, best)


def test_a_law_with_several_forms_says_which_one_is_there() -> None:
    """Two ripples of the load, of which the second one alone is there, 0.2 mm; and they never count as one effect of both."""
    waves = (lambda d: np.sin(d.load), lambda d: np.sin(0.6 * d.load))
    data = table(5, lambda d: 0.2 * waves[1](d))
    both = np.column_stack([wave(data) for wave in waves])
    third = -float(np.log(3.0))
    law = Law(
        "ripple",
        lambda _: both,
        np.array([0.3, 0.3]),
        ("first", "second"),
        ("mm", "mm"),
        choices=(((0, 1), third, ""), ((0,), third, "the first"), ((1,), third, "the second")),
    )
    found = there(read_by_levels(settle(channel(data, (law,)))))["ripple"]
    assert found.label == "the second"
    assert list(found.values) == ["second"]
    assert found.values["second"].value == pytest.approx(0.2, abs=4 * found.values["second"].uncertainty)


def test_a_law_that_is_not_proportional_to_its_amplitude_is_laid_out_about_it() -> None:
    """What saturates: tanh of amplitude and load. At small amplitudes it is the load itself, which has another shape."""
    data = table(6, lambda d: 0.3 * np.tanh(2.0 * d.load / 5.0), noise=0.02)
    share = data.load / 5.0

    def about(_: tuple[float, ...], amplitudes: NDArray[np.float64]) -> NDArray[np.float64]:
        return (0.3 * np.tanh(amplitudes[0] * share) / amplitudes[0])[:, None]

    law = Law("saturation", lambda _: 0.3 * share[:, None], np.array([1.0]), ("size",), ("",), at=about)
    found = there(read_by_levels(settle(replace(channel(data, (law,)), static=()), look=False)))["saturation"]
    assert found.values["size"].value == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("form_uncertainty", [0.0, 0.1])
def test_the_uncertainty_of_a_law_holds_what_its_formula_may_be_off_by(form_uncertainty: float) -> None:
    """A slope of least squares and a tenth of itself, in squares; the rest of the numbers is that of the exact formula."""
    data = table(2, EFFECTS["linear in q"])
    law = Law(
        "slope",
        lambda _shape: data.q[:, None],
        np.array([0.01]),
        ("slope",),
        ("mm/mm",),
        form_uncertainty=form_uncertainty,
    )
    finding = there(read_by_levels(settle(channel(data, (law,)))))["slope"]
    value = finding.values["slope"]
    columns = np.column_stack([np.ones(len(data.q)), data.q])
    exact = 0.1 * np.sqrt(np.linalg.inv(columns.T @ columns)[1, 1])
    assert value.value == pytest.approx(0.003, abs=4.0 * exact)
    assert value.uncertainty == pytest.approx(np.hypot(exact, form_uncertainty * value.value), rel=0.1)


@pytest.mark.parametrize(("form_uncertainty", "alike"), [(0.0, ()), (0.03, ("slope", "slope and a little more"))])
def test_what_two_formulas_may_be_off_by_is_not_decided_between_them(
    form_uncertainty: float, alike: tuple[str, ...]
) -> None:
    """A second law departs from the first by 3 % of it, 90 µm beside a noise of 20 µm: seen, and no more than formulas allow."""
    data = table(2, lambda d: 0.05 * d.q, noise=0.02)
    q = data.q - data.q.mean()
    other = np.cos(np.linspace(0.0, 61.0, len(q)))
    laws = [
        Law(name, lambda _, c=c: c[:, None], np.array([0.05]), ("size",), ("mm/mm",), form_uncertainty=form_uncertainty)
        for name, c in (
            ("slope", data.q),
            ("slope and a little more", data.q + 0.03 * other * np.linalg.norm(q) / np.linalg.norm(other)),
        )
    ]
    settled = settle(replace(channel(data, tuple(laws)), static=()), look=False)
    findings = {finding.name: finding for finding in read_by_levels(settled)}
    assert findings["slope"].equivalent == alike
