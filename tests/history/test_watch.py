"""What is found in simulated histories: as many false alarms as stated, changes as soon as theory says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from dbbstation.history.run_length import chart_for
from dbbstation.history.standardised import BASELINE
from dbbstation.history.watch import TrendVerdict, watch
from studies.history import signalled_within

K = 2.0
ONE = chart_for(1e-5)
"""As in a table of a hundred quantities."""


def tables_with_an_alarm(rng, *, tables, quantities, sessions, rate, scatter):
    """How many of so many whole tables raise an alarm although nothing changes."""
    chart = chart_for(rate / quantities)
    found = 0
    for _ in range(tables):
        u = rng.uniform(0.5, 2.0, (quantities, sessions))
        values = 40.0 + scatter * u * rng.standard_normal(u.shape)
        found += any(watch(row, of, chart, K).events for row, of in zip(values, u, strict=True))
    return found, chart


@pytest.mark.parametrize(
    ("scatter", "tables"), [(1.0, 500), (3.0, 150), pytest.param(3.0, 500, marks=pytest.mark.nightly)]
)  # where the scatter contradicts what is stated, a table takes seven times as long
def test_a_table_gives_as_many_false_alarms_as_stated(rng, scatter, tables):
    """So many tables; the stated share by the Markov chain, its 99.9 % binomial interval."""
    quantities, sessions, rate = 6, 110, 0.01
    found, chart = tables_with_an_alarm(
        rng, tables=tables, quantities=quantities, sessions=sessions, rate=rate, scatter=scatter
    )
    quiet = 1.0 - signalled_within(chart, [0.0] * (sessions - 1))[-1]
    low, high = stats.binom.interval(0.999, tables, 1.0 - quiet ** (2 * quantities))
    assert low <= found <= high
    assert 1.0 - quiet ** (2 * quantities) == pytest.approx(1.0 - np.exp(-rate * (sessions - 1)), abs=0.02)


def test_uncertainties_that_are_stated_too_large_give_fewer(rng):
    found, chart = tables_with_an_alarm(rng, tables=200, quantities=6, sessions=110, rate=0.01, scatter=0.4)
    quiet = 1.0 - signalled_within(chart, [0.0] * 109)[-1]
    assert found < stats.binom.interval(0.999, 200, 1.0 - quiet**12)[0]


def first_alarm(values, step_at, chart=ONE):
    found = [e.found for e in watch(values, np.ones(len(values)), chart, K).events]
    if found and found[0] < step_at:
        return np.nan
    return found[0] - step_at + 1 if found else np.inf


def delays_of(rows, step_at):
    delays = np.array([first_alarm(row, step_at) for row in rows])
    assert np.isnan(delays).mean() < 0.02
    return delays[~np.isnan(delays)]


@pytest.mark.parametrize("step", [1.0, 1.5, 2.0])
def test_a_step_is_found_as_soon_as_theory_says(rng, step):
    """After 200 sessions the level is known: the delay is that of the chain whose mean follows the level that gives way.

    The scatter gives way as well, by the square of the step, which the chain is told in the mean.
    """
    before, after = 200, 80
    values = rng.standard_normal((400, before + after))
    values[:, before:] += step
    delays = delays_of(values, before)
    j = np.arange(after)
    off = step * before / (before + j)
    widened = np.sqrt(1.0 + step**2 * before * j / (before + j) ** 2)
    quiet = 1.0 - signalled_within(ONE, [0.0] * (before - 1) + (off / widened).tolist())[before - 2 :]
    theory = np.sum(quiet[:-1]) / quiet[0]
    assert np.isfinite(delays).mean() > 0.95
    delays = np.minimum(delays, after)  # as the chain has it
    assert delays.mean() == pytest.approx(theory, abs=4.0 * delays.std() / np.sqrt(len(delays)))


def test_a_large_step_is_seen_by_the_second_session(rng):
    values = rng.standard_normal((100, 40))
    values[:, 30:] += 12.0
    for row in values:
        events = [e for e in watch(row, np.ones(40), ONE, K).events if e.found >= 30]
        assert (events[0].verdict, events[0].since, events[0].found) == (TrendVerdict.CHANGED, 30, 31)
        assert events[0].difference == pytest.approx(12.0, abs=5.0 * events[0].u_difference)


def test_a_drift_is_found(rng):
    values = rng.standard_normal((200, 160))
    values[:, 60:] += 0.05 * np.arange(100)
    delays = delays_of(values, 60)
    assert np.isfinite(delays).mean() > 0.99
    assert np.median(delays) < 50.0


def test_one_session_that_stands_out_does_not_move_the_level(rng):
    values = rng.standard_normal(60)
    values[40] += 15.0
    found = watch(values, np.ones(60), ONE, K)
    assert [(e.verdict, e.since, e.found) for e in found.events] == [(TrendVerdict.STANDS_OUT, 40, 40)]
    others = np.delete(values, 40)
    assert found.level[-1] == pytest.approx(others.mean())
    assert found.verdict is TrendVerdict.STANDS_OUT


def test_after_a_change_the_new_level_is_the_baseline(rng):
    values = rng.standard_normal(90)
    values[30:] += 9.0
    values[60:] -= 5.0
    found = watch(values, np.ones(90), ONE, K)
    assert [(e.verdict, e.since) for e in found.events] == [(TrendVerdict.CHANGED, 30), (TrendVerdict.CHANGED, 60)]
    assert found.level[29] == pytest.approx(values[:30].mean())
    assert found.level[50] == pytest.approx(values[32:60].mean())
    assert found.level[-1] == pytest.approx(values[62:].mean())
    assert found.u_level[-1] == pytest.approx(max(1.0, values[62:].std(ddof=1)) / np.sqrt(28))


def test_the_size_of_a_change_is_right_on_average(rng):
    values = rng.standard_normal((200, 90))
    values[:, 40:] += 3.0
    sizes = []
    for row in values:
        changes = [e for e in watch(row, np.ones(90), ONE, K).events if e.verdict is TrendVerdict.CHANGED]
        sizes += [(e.difference - 3.0) / e.u_difference for e in changes if e.since > 35]
    assert len(sizes) > 190
    assert np.mean(sizes) == pytest.approx(0.0, abs=4.0 / np.sqrt(len(sizes)))
    assert 0.8 < np.std(sizes) < 1.2


@pytest.mark.parametrize(("count", "lacking"), [(36, 1), (37, 0), (40, 0)])
def test_after_a_change_the_next_session_begins_the_level_and_the_one_after_is_watched(rng, count, lacking):
    values = rng.standard_normal(count)
    values[34:] += 20.0
    found = watch(values, np.ones(count), ONE, K)
    assert found.events[-1].found == 35
    assert found.lacking == lacking
    assert found.watched == count - 1 - (count > 36)
    assert found.verdict is TrendVerdict.CHANGED
    assert not found.by_stated


def test_after_a_change_the_scatter_of_before_is_still_known(rng):
    values = 3.0 * rng.standard_normal(50)
    values[30:] += 60.0
    values[36:] += 60.0
    found = watch(values, np.ones(50), ONE, K)
    assert [(e.verdict, e.since, e.by_stated) for e in found.events] == [
        (TrendVerdict.CHANGED, 30, False),
        (TrendVerdict.CHANGED, 36, False),
    ]


def test_one_session_cannot_tell(rng):
    found = watch(rng.standard_normal(1), np.ones(1), ONE, K)
    assert found.verdict is TrendVerdict.CANNOT_TELL
    assert found.lacking == 0


@pytest.mark.parametrize("count", range(2, BASELINE + 1))
def test_from_the_second_session_on_a_large_step_is_seen_by_stated_uncertainty(rng, count):
    values = rng.standard_normal(count)
    assert watch(values, np.ones(count), ONE, K).verdict is TrendVerdict.STEADY
    values[-1] += 20.0
    found = watch(values, np.ones(count), ONE, K)
    assert [(e.verdict, e.found, e.by_stated) for e in found.events] == [(TrendVerdict.STANDS_OUT, count - 1, True)]
    assert found.by_stated


def test_a_scatter_that_contradicts_by_chance_hides_no_large_step(rng):
    values = rng.standard_normal((400, 3))
    values[:, -1] += 20.0
    assert np.mean([bool(watch(row, np.ones(3), ONE, K).events) for row in values]) > 0.99


def test_a_change_in_the_first_sessions_stays_when_the_chart_takes_over(rng):
    values = rng.standard_normal(60)
    values[5:] += 20.0
    for count in (7, 10, 11, 12, 30, 60):
        found = watch(values[:count], np.ones(count), ONE, K)
        assert [(e.verdict, e.since) for e in found.events] == [(TrendVerdict.CHANGED, 5)], count


def test_a_few_sessions_give_as_many_false_alarms_as_stated(rng):
    """From two to ten sessions that scatter as stated; the 99.9 % binomial interval of the chain's share."""
    for sessions in (2, 5, 10):
        found, chart = tables_with_an_alarm(rng, tables=300, quantities=6, sessions=sessions, rate=0.01, scatter=1.0)
        quiet = 1.0 - signalled_within(chart, [0.0] * (sessions - 1))[-1]
        low, high = stats.binom.interval(0.999, 300, 1.0 - quiet**12)
        assert low <= found <= high


def test_sessions_that_scatter_by_more_than_stated_are_steady_once_that_is_seen(rng):
    values = 4.0 * rng.standard_normal((40, 50))
    early = [watch(row[:8], np.ones(8), ONE, K).verdict is not TrendVerdict.STEADY for row in values]
    late = [watch(row, np.ones(50), ONE, K).verdict is not TrendVerdict.STEADY for row in values]
    assert np.mean(early) < 0.4
    assert np.mean(late) < 0.05


def test_a_change_within_its_stated_uncertainty_is_none(rng):
    values = 0.01 * rng.standard_normal(60)
    values[30:] += 0.1
    assert watch(values, np.ones(60), ONE, K).verdict is TrendVerdict.STEADY
    assert watch(values, np.full(60, 0.01), ONE, K).verdict is TrendVerdict.CHANGED


def test_units_do_not_matter(rng):
    values = rng.standard_normal(80)
    values[50:] += 2.5
    one, other = watch(values, np.ones(80), ONE, K), watch(1e3 * values - 7e4, np.full(80, 1e3), ONE, K)
    assert [(e.since, e.found) for e in one.events] == [(e.since, e.found) for e in other.events]
    assert other.events[0].difference == pytest.approx(1e3 * one.events[0].difference)
