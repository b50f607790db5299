"""Held-out parts: what each effect gains is what a refit without it loses; what is chosen knows neither part nor neighbours."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from dbbstation.inference.folds import Fold, HeldOutError, held_out_error, part_numbers, parts_of, selections_without
from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels import FollowsAnswer, Gains, Verdict
from dbbstation.inference.levels_of import levels_of
from dbbstation.inference.read_off import Trial, read_off
from dbbstation.inference.settle import Beginning, settle
from tests.inference.tables import direction, table
from tests.inference.test_channel import EFFECTS, channel


@pytest.fixture(scope="module")
def both():
    """A channel with hysteresis and cogging, and what a comparison makes of it."""
    data = table(2, lambda d: EFFECTS["hysteresis of q"](d) + EFFECTS["twice per turn of angle"](d), rows=600)
    whole = channel(data, blocks=1)
    settled = settle(whole, thorough=False)
    assert settled.best.names == {"hysteresis of q", "twice per turn of angle"}
    return data, whole, settled


def test_gains_are_what_a_refit_without_an_effect_loses(both):
    data, whole, _ = both
    beginnings = (Beginning.EVERYTHING,)
    error = held_out_error(whole, selections_without(whole, partial(settle, look=False, beginnings=beginnings)))
    columns = {
        ("hysteresis of q",): [direction(data.q)],
        ("twice per turn of angle",): [np.cos(2.0 * np.radians(data.angle)), np.sin(2.0 * np.radians(data.angle))],
    }
    for fold, (_, rows) in zip(error.folds, parts_of(whole), strict=True):
        assert set(fold.gains) == set(columns)
        with_all = squares(data.residual, [c for own in columns.values() for c in own], rows)
        assert fold.after == pytest.approx(np.sqrt(with_all / rows.sum()), rel=0.02)
        for kind, gain in fold.gains.items():
            without = squares(data.residual, [c for k, own in columns.items() if k != kind for c in own], rows)
            assert gain == pytest.approx(without - with_all, rel=0.1, abs=0.02 * without)
    assert error.gains_of([("hysteresis of q",)]).predicts
    assert error.gains_of([("hysteresis of load",)]) == Gains((0.0,) * 10, (60,) * 10)
    each = [error.gains_of([kind]).total for kind in columns]
    assert error.gains_of(list(columns)).total == pytest.approx(sum(each))


def squares(residual, columns, rows):
    """Sum of squares of the errors of prediction of rows from the others, with a constant."""
    stacked = np.column_stack([np.ones(len(residual)), *columns])
    values, *_ = np.linalg.lstsq(stacked[~rows], residual[~rows], rcond=None)
    return float(np.sum((residual - stacked @ values)[rows] ** 2))


@pytest.mark.parametrize(("alike", "gap"), [(1.0, 0), (4.3, 5), (1000.0, 30)])
def test_neighbours_that_resemble_a_part_are_not_chosen_from(both, alike, gap):
    _, whole, settled = both
    seen = []

    def chosen(without):
        seen.append(np.flatnonzero(~without.kept))
        return settled

    selections_without(whole, chosen, alike=alike)
    assert len(seen) == 10
    # Ten parts of 60 rows; the widest gap is half of one.
    for k, rows in enumerate(seen):
        assert (rows[0], rows[-1]) == (max(60 * k - gap, 0), min(60 * k + 59 + gap, 599))
        assert len(rows) == rows[-1] - rows[0] + 1


def sizes_of(lengths):
    number = part_numbers(lengths)
    assert len(number) == sum(lengths)
    assert (np.diff(number) >= 0).all()
    return np.bincount(number).tolist()


@pytest.mark.parametrize(
    ("lengths", "sizes"),
    [
        ([1000], [100] * 10),
        ([300, 700], [100] * 10),
        ([100] * 6, [100] * 6),
        ([100] * 20, [200] * 10),
        # One of eleven has 88 % of the rows: nine pieces of it, and the others together.
        ([880, *[12] * 10], [97, 98, 98, 98, 97, 98, 98, 98, 98, 120]),
        # One of five, a fifth of the rows being a part: short ones at the ends, under half of that, join their neighbours.
        ([15, 14, 340, 16, 15], [114, 85, 85, 116]),
        ([25, 25, 300, 25, 25], [50, 75, 75, 75, 75, 50]),
        ([3], [1, 1, 1]),
    ],
)
def test_parts_are_of_like_size(lengths, sizes):
    assert sizes_of(lengths) == sizes


def test_no_part_is_far_from_an_even_share(rng):
    """Whatever blocks there are: between a third and 2.5 of the mean, ten at most, and no short block is cut."""
    for _ in range(200):
        lengths = np.ceil(np.exp(rng.uniform(0.0, 7.0, rng.integers(1, 40)))).astype(int).tolist()
        if sum(lengths) < 200:
            continue
        sizes = sizes_of(lengths)
        assert 2 <= len(sizes) <= 10
        assert max(sizes) <= 2.5 * np.mean(sizes)
        assert min(sizes) >= np.mean(sizes) / 3.0
        number, ends = part_numbers(lengths), np.cumsum([0, *lengths])
        for first, last in pairwise(ends):
            if last - first < 1.5 * sum(lengths) / 10:
                assert number[first] == number[last - 1]


def test_what_counts_parts_weighs_their_rows():
    """Six short parts of ten gain, and one long one: 70 % of the parts, 40 % of the rows."""
    gains = Gains((1.0,) * 7 + (-0.1,) * 3, (10,) * 6 + (40,) + (50,) * 3)
    assert gains.share_with_gain == pytest.approx(0.4)
    assert not gains.predicts
    assert Gains(gains.parts).predicts


def test_whole_blocks_have_no_gap(both):
    data, _, settled = both
    seen = []
    selections_without(channel(data, blocks=6), lambda c: seen.append(int((~c.kept).sum())) or settled, alike=9.0)
    assert seen == [100] * 6


def test_the_reference_is_what_the_client_says(both):
    _, whole, settled = both
    parts = selections_without(whole, lambda _: settled)
    error = held_out_error(whole, parts, lambda _: np.zeros(600))
    assert error.as_simulated == pytest.approx(np.sqrt(np.mean(whole.residual**2)))
    plain = held_out_error(whole, parts)
    assert plain.as_simulated == pytest.approx(np.std(whole.residual), rel=0.05)


def trial(kinds, after, *, as_simulated=1.0):
    folds = [Fold(str(k), 60, as_simulated, 1.0, after, dict.fromkeys(kinds, 1.0)) for k in range(10)]
    return Trial(HeldOutError(tuple(folds)))


@pytest.mark.parametrize(("last", "persists"), [(600, True), (300, False)])
def test_what_came_once_has_happened_and_a_step_that_gains_persists(last, persists):
    data = table(4, rows=600)
    inside = (np.arange(600) >= 200) & (np.arange(600) < last)
    whole = channel(data, blocks=1)
    settled = settle(replace(whole, residual=whole.residual + 0.3 * inside))
    (name,) = [name for name in settled.best.names if "rows" in name]
    levels = levels_of(settled, left_over(settled), None)
    every = {one.name: one for one in read_off(settled, trial([settled.bank.kind_of(name)], 0.5), levels)}
    assert not any(one.verdict is Verdict.IDENTIFIED for one in every.values())
    told = every[name]
    assert told.verdict is Verdict.HAPPENED
    assert told.persists is persists
    without = {one.name: one for one in read_off(settled, trial([], 0.5), levels)}[name]
    assert without.verdict is Verdict.HAPPENED
    assert not without.persists


def test_what_came_once_beside_what_does_not_predict_is_not_sure():
    data = table(2, EFFECTS["hysteresis of q"], rows=600)
    whole = channel(data, blocks=1)
    inside = (np.arange(600) >= 200) & (np.arange(600) < 280)
    settled = settle(replace(whole, residual=whole.residual + 0.4 * inside))
    (pulse,) = settled.best.names - {"hysteresis of q"}
    found = levels_of(settled, left_over(settled), None)

    def told(answer, *, correction):
        classes = [replace(one, answer=answer) if "hysteresis of q" in one.members else one for one in found.follows]
        levels = replace(found, follows=tuple(classes), correction=correction)
        return {one.name: one for one in read_off(settled, Trial(), levels)}

    for answer, correction in ((FollowsAnswer.DOES_NOT_PREDICT, True), (FollowsAnswer.FOLLOWS, False)):
        assert told(answer, correction=correction)[pulse].verdict is Verdict.HAPPENED
    refuted = told(FollowsAnswer.DOES_NOT_PREDICT, correction=False)
    assert refuted["hysteresis of q"].verdict is Verdict.DOES_NOT_PREDICT
    assert refuted[pulse].verdict is Verdict.AMBIGUOUS
    assert "may make up for that" in refuted[pulse].text
