"""Evidence and selection on a plain problem without a machine: sines on a line, answers in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from dbbstation.inference.concealment import concealment
from dbbstation.inference.harmonics import bands, coefficients, misfit, smooth
from dbbstation.inference.held_out import held_out
from dbbstation.inference.race import Candidate, Variant, race_on, select
from dbbstation.inference.square_root import Columns, compress, joined, solve

NOISE = 0.5
T = np.linspace(0, 1, 60, endpoint=False)
RUNS = 4
NONE_HELD = np.zeros((0, 2))


def terms(run):
    """Base: constant and slope; candidates: a sine, a cosine of another pitch, a square; the slope grows by run."""
    return np.column_stack(
        [
            np.ones(60),
            T + run,
            np.sin(2 * np.pi * T),
            np.cos(6 * np.pi * T),
            np.sign(np.sin(2 * np.pi * T)),
            (T + run) ** 2,
        ]
    )


BASE = Columns(np.full(2, np.inf), np.ones(2), np.zeros(2, dtype=bool))
CANDIDATES = tuple(
    Candidate(name, (Variant(np.array([k]), np.array([2.0])),))
    for k, name in enumerate(("sine", "cosine", "square", "parabola"), start=2)
)


def raced(rng, amplitudes, noise=NOISE):
    x = np.concatenate([[3.0, -1.0], amplitudes])
    targets = [terms(run) @ x + rng.normal(0, noise, 60) for run in range(RUNS)]
    blocks = [compress(np.arange(6), terms(run), target) for run, target in enumerate(targets)]
    return race_on(blocks, BASE, NONE_HELD, 6, noise), blocks, targets


def test_evidence_is_the_ratio_of_marginal_likelihoods(rng):
    """Against the dense Gaussian integral, with a base prior wide enough to be flat."""
    race, _, targets = raced(rng, [0.4, 0.0, 0.0, 0.0])
    whole, target = np.vstack([terms(run) for run in range(RUNS)]), np.concatenate(targets)
    flat = 1e4 * whole[:, :2] @ whole[:, :2].T + NOISE**2 * np.eye(len(target))

    def log_marginal(columns):
        return multivariate_normal.logpdf(target, cov=flat + 4.0 * whole[:, columns] @ whole[:, columns].T)

    none = multivariate_normal.logpdf(target, cov=flat)
    for columns in ([2], [3], [2, 4], [2, 3, 5]):
        variants = [CANDIDATES[c - 2].variants[0] for c in columns]
        assert race.evidence(variants) == pytest.approx(log_marginal(columns) - none, abs=1e-3)


def test_amplitudes_are_those_of_the_full_fit(rng):
    race, blocks, _ = raced(rng, [0.4, 0.0, 0.0, 0.1])
    variants = [CANDIDATES[0].variants[0], CANDIDATES[3].variants[0]]
    known = Columns(np.array([np.inf, np.inf, 2.0, 2.0]), np.ones(4), np.array([False, False, True, True]))
    thin = [compress(np.arange(4), terms(run)[:, [0, 1, 2, 5]], _target(blocks[run], run)) for run in range(RUNS)]
    solution = solve(thin, known, NOISE)
    found = race.amplitudes(variants)
    assert found.values == pytest.approx(solution.x[2:], abs=1e-9)
    assert found.covariance == pytest.approx(solution.covariance[2:, 2:], abs=1e-12)


def _target(block, run):
    """A target that the block holds: its triangle and right-hand side say the same as the samples did."""
    fitted, *_ = np.linalg.lstsq(block.triangle, block.target, rcond=None)
    return terms(run) @ fitted


def test_the_right_terms_are_selected_and_nothing_when_there_is_nothing(rng):
    wrong = 0
    for _ in range(40):
        race, _, _ = raced(rng, [0.0, 0.0, 0.0, 0.0])
        wrong += bool(select(race, CANDIDATES, 6.0, 3))
        race, _, _ = raced(rng, [0.6, 0.0, 0.0, 0.5])
        assert {c.candidate.name for c in select(race, CANDIDATES, 6.0, 3)} == {"sine", "parabola"}
    assert wrong == 0


def test_a_square_is_not_taken_for_a_sine(rng):
    race, _, _ = raced(rng, [0.0, 0.0, 0.6, 0.0])
    assert [c.candidate.name for c in select(race, CANDIDATES, 6.0, 3)] == ["square"]


def test_the_best_variant_is_found_and_its_choice_is_paid_for(rng):
    """Two forms of one candidate: evidence together is at most that of the best, less at the most log 2."""
    race, _, _ = raced(rng, [0.6, 0.0, 0.0, 0.0])
    both = Candidate("either", (CANDIDATES[0].variants[0], CANDIDATES[1].variants[0]))
    variant, together = race.best_variant(both, [])
    alone = race.evidence([CANDIDATES[0].variants[0]])
    assert variant is CANDIDATES[0].variants[0]
    assert alone - np.log(2) - 1e-9 <= together <= alone


def test_the_gain_of_a_form_is_its_evidence_also_beside_others(rng):
    race, _, _ = raced(rng, [0.6, 0.02, -0.01, 0.3])
    both = Variant(np.array([3, 4]), np.array([2.0, 1.0]))
    assert race.gain(both) == pytest.approx(race.evidence([both]), abs=1e-7)
    others = [CANDIDATES[0].variants[0], CANDIDATES[3].variants[0]]
    variant, found = race.best_variant(Candidate("both", (both,)), others)
    assert variant is both
    assert found == pytest.approx(race.evidence([*others, both]), abs=1e-7)


def test_concealed_share_by_hand():
    """A slope conceals of a parabola on [-1, 1] nothing, a constant 5/9, constant and slope together 5/9."""
    t = np.linspace(-1, 1, 20001)
    block = compress(np.arange(3), np.column_stack([np.ones_like(t), t, t**2]), np.zeros_like(t))

    def share(fitted):
        return concealment([block], np.array(fitted), np.array([2]), np.array([1.0])).share

    assert share([1]) == pytest.approx(0.0, abs=1e-6)
    assert share([0]) == pytest.approx(5 / 9, abs=1e-3)
    assert share([0, 1]) == pytest.approx(5 / 9, abs=1e-3)
    slope_only = np.array([[0.0], [1.0]])
    held = concealment([block], np.array([0, 1]), np.array([2]), np.array([1.0]), slope_only)
    assert held.share == pytest.approx(0.0, abs=1e-6)


def test_left_out_runs_are_predicted_as_by_hand(rng):
    _, blocks, targets = raced(rng, [0.6, 0.0, 0.0, 0.0])
    known = Columns(
        np.concatenate([np.full(2, np.inf), np.full(4, 2.0)]),
        np.ones(6),
        np.array([False, False, True, True, True, True]),
    )
    squares = 0.0
    for out in range(RUNS):
        kept = [run for run in range(RUNS) if run != out]
        whole = np.vstack([terms(run)[:, :2] for run in kept])
        fitted, *_ = np.linalg.lstsq(whole, np.concatenate([targets[run] for run in kept]), rcond=None)
        squares += np.sum((targets[out] - terms(out)[:, :2] @ fitted) ** 2)
    found = held_out(blocks, list(range(RUNS)), known, np.array([0, 1]), NOISE, NONE_HELD)
    assert found.rms == pytest.approx(np.sqrt(squares / 240), rel=1e-9)


def test_left_out_runs_in_units_of_their_predicted_covariance(rng):
    """Random effects that only a left-out run knows, and a model that is right: chi-square over its freedom."""
    columns = [np.array([0, 1, 2 + run]) for run in range(RUNS)]
    known = Columns(np.array([np.inf, np.inf] + [0.8] * RUNS), np.ones(2 + RUNS), np.array([False] * 2 + [True] * RUNS))
    active, found, wrong = np.arange(2 + RUNS), [], []
    for _ in range(200):
        jacobians = [np.column_stack([terms(run)[:, :2], np.sin(2 * np.pi * T)]) for run in range(RUNS)]
        x = np.concatenate([[3.0, -1.0], rng.normal(0, 0.8, RUNS)])
        targets = [j @ x[c] + rng.normal(0, NOISE, 60) for j, c in zip(jacobians, columns, strict=True)]
        blocks = [compress(c, j, t) for c, j, t in zip(columns, jacobians, targets, strict=True)]
        found.append(held_out(blocks, list(range(RUNS)), known, active, NOISE, NONE_HELD).normalised)
        narrow = Columns(np.where(known.random, 0.1, known.prior), known.scale, known.random)
        wrong.append(held_out(blocks, list(range(RUNS)), narrow, active, NOISE, NONE_HELD).normalised)
    # Three rows of each of four runs: 12 degrees of freedom, dependent a little, in each of 200 draws.
    assert np.mean(np.square(found)) == pytest.approx(1.0, abs=0.1)
    assert np.mean(np.square(wrong)) > 3.0


def test_left_out_runs_with_correlated_noise_are_measured_by_that_of_a_single_sample(rng):
    """A moving average of three has a third of the variance, and low harmonics feel it as the white noise before it."""
    found = []
    for _ in range(20):
        noises = [np.convolve(rng.normal(0, NOISE, 62), np.ones(3) / 3, "valid") for _ in range(RUNS)]
        targets = [terms(run)[:, :2] @ (3.0, -1.0) + noise for run, noise in enumerate(noises)]
        blocks = [compress(np.arange(6), terms(run), target) for run, target in enumerate(targets)]
        known = Columns(np.full(6, np.inf), np.ones(6), np.zeros(6, dtype=bool))
        single = NOISE / np.sqrt(3)
        told = held_out(blocks, list(range(RUNS)), known, np.array([0, 1]), NOISE, NONE_HELD, single)
        plain = held_out(blocks, list(range(RUNS)), known, np.array([0, 1]), NOISE, NONE_HELD)
        assert told.rms == plain.rms
        found.append(told.normalised / plain.normalised)
    # More than by the ratio of the noises alone, since what was fitted is as uncertain as before.
    assert 1.0 < np.median(found) <= np.sqrt(3)


def test_two_effects_that_hide_each_other_are_found_as_a_pair(rng):
    """Columns that are nearly opposite: each alone explains next to nothing of their sum, both explain it all."""
    line = rng.normal(size=240)
    other = -line + 0.05 * rng.normal(size=240)
    third = rng.normal(size=240)
    jacobian = np.column_stack([np.ones(240), line, other, third])
    target = jacobian @ [1.0, 10.0, 10.0, 0.0] + rng.normal(0, 0.1, 240)
    base = Columns(np.full(1, np.inf), np.ones(1), np.zeros(1, dtype=bool))
    race = race_on([compress(np.arange(4), jacobian, target)], base, np.zeros((0, 1)), 4, 0.1)
    candidates = [
        Candidate(name, (Variant(np.array([k]), np.array([20.0])),)) for k, name in enumerate(("a", "b", "c"), start=1)
    ]
    assert {choice.candidate.name for choice in select(race, candidates, 5.0, 3)} == {"a", "b"}


def test_visible_is_plausible_size_over_standard_deviation(rng):
    """Against the covariance of a fit of base and one column by least squares."""
    race, _, _ = raced(rng, [0.0, 0.0, 0.0, 0.0])
    whole = np.vstack([terms(run) for run in range(RUNS)])
    for k, candidate in enumerate(CANDIDATES, start=2):
        columns = whole[:, [0, 1, k]]
        sigma = NOISE * np.sqrt(np.linalg.inv(columns.T @ columns)[2, 2])
        assert race.visible(candidate.variants[0]) == pytest.approx([2.0 / sigma], rel=1e-6)


def test_of_two_amplitudes_that_only_their_sum_shows_one_combination_is_visible(rng):
    line = rng.normal(size=200)
    jacobian = np.column_stack([np.ones(200), line, line])
    base = Columns(np.full(1, np.inf), np.ones(1), np.zeros(1, dtype=bool))
    race = race_on([compress(np.arange(3), jacobian, line)], base, np.zeros((0, 1)), 3, 0.1)
    both = Variant(np.array([1, 2]), np.ones(2))
    seen = race.visible(both)
    # Along (1, 1) / sqrt(2) the column is sqrt(2) times the line.
    expected = np.sqrt(2.0) * np.linalg.norm(line - line.mean()) / 0.1
    assert seen == pytest.approx([expected, 0.0], abs=1e-6 * expected)


def test_joined_blocks_say_what_they_said_apart(rng):
    race, blocks, _ = raced(rng, [0.6, 0.0, 0.3, 0.0])
    together = race_on([joined(blocks, 6)], BASE, NONE_HELD, 6, NOISE)
    assert together.chi2 == pytest.approx(race.chi2)
    variants = [candidate.variants[0] for candidate in CANDIDATES[:2]]
    assert together.evidence(variants) == pytest.approx(race.evidence(variants))


def test_coefficients_of_white_noise_and_of_a_sine(rng):
    phase = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    sine = coefficients(0.3 * np.cos(5 * phase), phase, 60)
    assert np.flatnonzero(np.abs(sine) > 1e-9).tolist() == [5]
    assert sine[5] ** 2 / 720 == pytest.approx(0.3**2 / 2)
    white = np.array([coefficients(rng.normal(0, 2.0, 720), phase, 60) for _ in range(200)])
    assert white.std() == pytest.approx(2.0, rel=0.02)


def test_misfit_probability_is_uniform_on_noise_and_small_on_a_misfit(rng):
    phase = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    groups = [k // 2 for k in range(6)]
    shifts = rng.normal(0, 5.0, (3, 2))  # where a ball came to stand, common to the runs of a group

    def runs(extra):
        return [rng.normal(0, 1.0, 360) + extra + shifts[k // 2] @ [np.cos(phase), np.sin(phase)] for k in range(6)]

    found = [misfit(runs(0.0), [phase] * 6, groups, 0.0) for _ in range(300)]
    probabilities = np.array([m.probability for m in found])
    assert 0.03 < np.mean(probabilities < 0.1) < 0.18
    assert np.mean([m.noise for m in found]) == pytest.approx(1.0, rel=0.01)
    seen = misfit(runs(0.5 * np.sin(3 * phase)), [phase] * 6, groups, 0.0)
    assert seen.probability < 1e-6
    assert seen.rms == pytest.approx(0.5 / np.sqrt(2), rel=0.1)


@pytest.mark.parametrize(("white", "pushed", "phi"), [(0.5, 0.5, 0.6), (0.3, 0.3, 0.9)])
def test_correlated_noise_is_no_misfit_and_its_low_level_is_known(rng, white, pushed, phi):
    """A first-order process has S(0) = s² (1 + phi) / (1 - phi), which the harmonics above the low ones do not reach."""
    phase = np.linspace(0, 2 * np.pi, 720, endpoint=False)

    def run():
        pushes = pushed * rng.normal(size=820)
        pushes[1:] *= np.sqrt(1 - phi**2)
        return white * rng.normal(size=720) + lfilter([1.0], [1.0, -phi], pushes)[100:]

    found = [misfit([run() for _ in range(20)], [phase] * 20, [k // 2 for k in range(20)], 0.0) for _ in range(12)]
    assert min(m.probability for m in found) > 1e-3
    true = np.sqrt(white**2 + pushed**2 * (1 + phi) / (1 - phi))
    assert np.median([m.noise for m in found]) == pytest.approx(true, rel=0.3)


@pytest.mark.parametrize("size", [0.3, 1.0, 5.0])
def test_steps_are_a_misfit_though_they_reach_into_the_harmonics_that_noise_is_read_from(rng, size):
    phase = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    runs = [rng.normal(0, 0.5, 720) + size * (-1) ** k * np.sign(np.sin(phase + 0.2 * k)) for k in range(20)]
    seen = misfit(runs, [phase] * 20, [k // 2 for k in range(20)], 0.0)
    assert seen.probability < 1e-6
    assert seen.rms == pytest.approx(size, rel=0.1)


def test_few_samples_per_period_are_looked_at_in_fewer_harmonics(rng):
    phase = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    assert bands(720) == (30, 240)
    assert bands(90) == (7, 30)
    found = [misfit([rng.normal(0, 1.0, 90) for _ in range(10)], [phase] * 10, range(10), 0.0) for _ in range(50)]
    assert np.mean([m.probability < 0.05 for m in found]) < 0.2
    assert np.mean([m.noise for m in found]) == pytest.approx(1.0, rel=0.05)


def test_nothing_left_at_all_is_no_misfit():
    phase = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    assert misfit([np.zeros(720)] * 4, [phase] * 4, [0, 0, 1, 1], 0.0).probability == 1.0


def test_what_was_held_may_still_be_seen_a_little_and_is_then_no_sign_of_a_candidate(rng):
    """The slope of the base was held at zero. A candidate that is nearly a slope must not stand in for it."""
    held = np.array([[0.0, 1.0]])
    nearly = Columns(np.full(2, np.inf), np.array([1.0, 2.0]), np.zeros(2, dtype=bool))
    for slope, noise in ((1.5, NOISE), (1.5, 0.1 * NOISE)):
        columns = [np.column_stack([np.ones(60), T, T + 0.02 * np.sin(2 * np.pi * T)]) for _ in range(RUNS)]
        targets = [slope * T + rng.normal(0, noise, 60) for _ in columns]
        blocks = [compress(np.arange(3), c, t) for c, t in zip(columns, targets, strict=True)]
        race = race_on(blocks, nearly, held, 3, noise)
        flat = np.vstack(columns)[:, :2] * [1e2, 2.0]
        spread = flat @ flat.T + noise**2 * np.eye(60 * RUNS)
        own = np.vstack(columns)[:, 2:]
        logs = [multivariate_normal.logpdf(np.concatenate(targets), cov=spread + 4.0 * k * own @ own.T) for k in (0, 1)]
        found = race.evidence([Variant(np.array([2]), np.array([2.0]))])
        assert found == pytest.approx(logs[1] - logs[0], abs=1e-3)
        assert found < 0


def test_two_that_make_each_other_needless_do_not_hang_the_selection(rng):
    """A square and its copy with a little noise: at the most one of them is worth anything beside the other."""
    x = np.sign(np.sin(2 * np.pi * T))
    columns = np.column_stack([np.ones(60), T, x, x + 0.02 * rng.normal(size=60), x + 0.02 * rng.normal(size=60)])
    target = columns @ np.array([1.0, 0.0, 0.5, 0.5, 0.5]) + rng.normal(0, NOISE, 60)
    race = race_on([compress(np.arange(5), columns, target)], BASE, NONE_HELD, 5, NOISE)
    candidates = [Candidate(str(k), (Variant(np.array([k]), np.array([2.0])),)) for k in (2, 3, 4)]
    assert len(select(race, candidates, 6.0, 3)) == 1


def test_smoothing_keeps_low_and_drops_high_harmonics():
    phase = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    low, high = np.cos(7 * phase), np.cos(44 * phase)
    assert smooth(low + high, phase) == pytest.approx(low, abs=1e-9)
