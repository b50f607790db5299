"""The first look for waves, bumps and steps explains what a least-squares fit with the base beside it explains."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from dbbstation.diagnosis.shapes import BALL, EVERY, PLAUSIBLE_MM, READING, TABLE, TOOL, Samples
from dbbstation.diagnosis.unmodelled import Ranges, TemplateScan, looked_for
from dbbstation.inference.forms import Bump, Ringing, Wave
from dbbstation.inference.square_root import Columns

NOISE_MM = 5e-4
SAMPLES = 2000


def runs_of(rng, seconds):
    """Two runs whose struts move as sines, seen with gains that change along the way."""
    found = []
    for k in range(2):
        turn = np.arange(SAMPLES) / SAMPLES
        theta = 2 * np.pi * turn
        # Strut lengths on a grid of one per piece: adding up over pieces loses nothing then.
        length = np.round(700 + 80 * np.sin(theta[:, None] + np.arange(6))) + 0.25
        values = {
            "strut-length": length,
            "time": seconds * (k + turn),
            "angle": np.degrees(theta),
            "angle since the start": (1 - 2 * k) * turn,
            "strut-force": 1005.0 + 5.0 * np.cos(theta[:, None] + np.arange(6)),
            "time since its reversal": np.mod(40.0 * turn[:, None] + np.arange(6), 10.0) * (1 - 2 * k),
            "position of the platform": 150 * np.column_stack([np.cos(theta), np.sin(theta)]),
        }
        gain = {
            EVERY: rng.uniform(-1, 1, 6) + 0.3 * np.cos(theta[:, None] * np.arange(2, 8) + rng.uniform(0, 6, 6)),
            READING: np.ones((SAMPLES, 1)),
            BALL: np.column_stack([-np.cos(theta), -np.sin(theta), np.full(SAMPLES, 0.1)]),
            TOOL: np.column_stack([np.cos(theta), np.sin(theta), np.full(SAMPLES, 0.1)]),
            TABLE: np.tile(-np.cos(theta)[:, None], (1, 6)) * rng.uniform(0.5, 1, 6),
        }
        found.append(Samples(values, gain))
    return found


def problem(rng, hidden, seconds=40.0):
    runs = runs_of(rng, seconds)
    theta = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    base = [np.column_stack([np.ones(SAMPLES), np.cos(theta), np.sin(theta), run.gain[EVERY]]) for run in runs]
    known = Columns(np.r_[1e-3, np.full(8, np.inf)], np.full(9, 1.0), np.r_[True, np.zeros(8, dtype=bool)])
    read = np.concatenate([hidden(run) for run in runs]) + NOISE_MM * rng.standard_normal(2 * SAMPLES)
    rows = np.vstack([np.vstack(base), np.r_[NOISE_MM / 1e-3, np.zeros(8)]])
    x = np.linalg.lstsq(rows, np.r_[read, 0.0], rcond=None)[0]
    left = np.split(read - np.vstack(base) @ x, 2)
    return runs, base, read, TemplateScan(runs, left, base, known, np.zeros((0, 9)), NOISE_MM)


def extent_of(runs):
    names = runs[0].values
    return Ranges(
        {name: np.min([run.values[name].min(axis=0) for run in runs], axis=0) for name in names},
        {name: np.max([run.values[name].max(axis=0) for run in runs], axis=0) for name in names},
    )


def by_brute_force(base, read, columns):
    """Fall of the weighted sum of squares by columns with their prior, the base fitted with them and without."""
    prior = np.zeros((1 + columns.shape[1], 9 + columns.shape[1]))
    prior[0, 0] = NOISE_MM / 1e-3
    prior[1:, 9:] = np.eye(columns.shape[1]) * NOISE_MM / PLAUSIBLE_MM
    target = np.r_[read, np.zeros(len(prior))]
    squares = []
    for count in (9, 9 + columns.shape[1]):
        rows = np.vstack([np.hstack([np.vstack(base), columns]), prior])[:, :count]
        x = np.linalg.lstsq(rows, target, rcond=None)[0]
        squares.append(np.sum((target - rows @ x) ** 2))
    return (squares[0] - squares[1]) / NOISE_MM**2


@pytest.mark.parametrize("form", [Wave(1 / 17.3), Bump(712.0, 9.0)])
def test_what_a_curve_explains_is_that_of_a_fit_beside_the_base(form):
    rng = np.random.default_rng(3)
    runs, base, read, look = problem(
        rng, lambda run: 2e-3 * run.gain[EVERY][:, 2] * np.sin(run.values["strut-length"][:, 2] / 2.7)
    )
    sums = look.sums("strut-length", 3, EVERY, partial(lambda values: np.floor(values / 0.5).astype(np.int64)))
    columns = np.vstack([run.gain[EVERY][:, 2:3] * form.columns(run.values["strut-length"][:, 2]) for run in runs])
    (explained,) = sums.explained(form.columns(sums.at)[:, None, :])
    assert explained == pytest.approx(by_brute_force(base, read, columns), rel=1e-6)
    assert explained > 5


def test_a_ball_that_moves_in_three_directions_is_explained_alike():
    rng = np.random.default_rng(4)
    runs, base, read, look = problem(
        rng, lambda run: 1e-3 * run.gain[BALL][:, 1] * np.sin(2 * np.pi * run.values["time"] / 7.1)
    )
    form = Wave(1 / 7.0)
    sums = look.sums("time", None, BALL, lambda values: np.round(values * SAMPLES).astype(np.int64))
    columns = np.vstack(
        [
            (run.gain[BALL][:, :, None] * form.columns(run.values["time"])[:, None, :]).reshape(SAMPLES, -1)
            for run in runs
        ]
    )
    (explained,) = sums.explained(form.columns(sums.at)[:, None, :])
    assert explained == pytest.approx(by_brute_force(base, read, columns), rel=1e-6)


@pytest.mark.parametrize(
    ("variable", "kind", "strut", "moves", "hidden", "frequency", "within"),
    [
        (
            "time",
            "wave",
            5,
            EVERY,
            lambda run: 5e-4 * run.gain[EVERY][:, 4] * np.sin(2 * np.pi * run.values["time"] / 6.37),
            1 / 6.37,
            1e-3,
        ),
        (
            "time",
            "wave",
            None,
            BALL,
            lambda run: 5e-4 * run.gain[BALL][:, 0] * np.cos(2 * np.pi * run.values["time"] / 11.9),
            1 / 11.9,
            1e-3,
        ),
        (
            "strut-length",
            "wave",
            2,
            EVERY,
            lambda run: 5e-4 * run.gain[EVERY][:, 1] * np.sin(2 * np.pi * run.values["strut-length"][:, 1] / 9.3),
            1 / 9.3,
            1e-3,
        ),
        (
            "angle since the start",
            "wave",
            None,
            READING,
            lambda run: 5e-4 * np.sin(2 * np.pi * 3.7 * run.values["angle since the start"]),
            3.7,
            0.06,
        ),
    ],
)
def test_the_strongest_wave_is_the_hidden_one(variable, kind, strut, moves, hidden, frequency, within):
    rng = np.random.default_rng(5)
    runs, _, _, look = problem(rng, hidden)
    shapes = looked_for(look, extent_of(runs))
    of_it = [s for s in shapes if (s.variable, s.kind, s.strut, s.moves) == (variable, kind, strut, moves)]
    assert of_it[0].form.frequency == pytest.approx(frequency, abs=within)
    assert all(shape.tried >= 1 for shape in shapes)


def test_a_dent_is_found_where_it_is():
    rng = np.random.default_rng(6)
    dent = Bump(731.0, 6.0)
    runs, _, _, look = problem(
        rng, lambda run: 1e-3 * run.gain[EVERY][:, 3] * dent.columns(run.values["strut-length"][:, 3])[:, 0]
    )
    bump = next(
        s for s in looked_for(look, extent_of(runs)) if (s.variable, s.kind, s.strut) == ("strut-length", "bump", 4)
    )
    assert bump.form.centre == pytest.approx(731.0, abs=3.0)
    assert bump.form.width in {5.0, 8.0}


def test_a_step_over_a_force_is_found_where_it_is():
    """Forces reach from 1000 to 1010 N, and places of steps are a fortieth of that apart."""
    rng = np.random.default_rng(8)
    runs, _, _, look = problem(
        rng, lambda run: 1e-3 * run.gain[EVERY][:, 1] * np.sign(run.values["strut-force"][:, 1] - 1003.3)
    )
    shapes = looked_for(look, extent_of(runs))
    step = next(s for s in shapes if (s.variable, s.kind, s.strut) == ("strut-force", "step", 2))
    assert step.form.at == pytest.approx(1003.3, abs=0.25)


def test_two_struts_that_ring_with_different_periods_are_both_told():
    """Every strut is then tried with either period; grid periods are 7 % apart."""
    rng = np.random.default_rng(9)
    hidden = {1: Ringing(0.5, 1.6), 4: Ringing(1.5, 1.6)}

    def ringing(run):
        since = run.values["time since its reversal"]
        return sum(
            2e-3 * run.gain[EVERY][:, strut - 1] * form.columns(since[:, strut - 1])[:, 0]
            for strut, form in hidden.items()
        )

    runs, _, _, look = problem(rng, ringing)
    shapes = [s for s in looked_for(look, extent_of(runs)) if s.kind == "ringing"]
    for form in hidden.values():
        near = {s.strut for s in shapes if s.form.period == pytest.approx(form.period, rel=0.05)}
        assert near == set(range(1, 7))
