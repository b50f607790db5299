"""Causes of which one is there for sure: against sums over all sets of causes, one by one."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from dbbstation.inference.alternatives import EVEN, Alternatives, named_already, standing_out, would_show
from dbbstation.inference.hypotheses import Hypothesis, Posterior
from dbbstation.inference.levels import OUT, SURE
from dbbstation.inference.model_comparison import Variant
from dbbstation.inference.settle import Outcome
from tests.inference.dense import Dense, variant

NAMES = "abcdef"


def rough(share: float, *columns: int) -> Variant:
    return replace(variant(*columns), form_uncertainty=share)


def posterior_of(probabilities: dict[str, float]) -> Posterior:
    weights = {frozenset(names): float(np.log(p)) for names, p in probabilities.items()}
    return Posterior((Hypothesis((), 0.0),), weights)


def alternatives(posterior: Posterior) -> Alternatives:
    return Alternatives(Outcome(causes=(), comparison=None, posterior=posterior), ())  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(20))
def test_probabilities_are_sums_over_sets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sets = ["".join(chosen) for size in range(4) for chosen in combinations(NAMES, size)]
    drawn = rng.dirichlet(np.full(len(sets), 0.1))
    posterior = posterior_of({names: p for names, p in zip(sets, drawn, strict=True) if p > 0.0})
    found = alternatives(posterior)
    for wanted in ("a", "bc", "adf", NAMES):
        exact = sum(p for names, p in zip(sets, drawn, strict=True) if set(names) & set(wanted))
        # Sets with less than e^-30 of the best count for nothing.
        assert posterior.probability(wanted) == pytest.approx(exact, abs=1e-9)
    for name in NAMES:
        others = found.ambiguity(name)
        if others:
            assert name not in others
            assert posterior.probability((name, *others)) >= SURE
            # Without the last of them it would not be sure.
            assert posterior.probability((name, *others[:-1])) < SURE


def test_no_probability_is_above_one(rng) -> None:
    # Where nearly all of the sum is inside, a sum over a part can round to more than the sum over all: 7 in 1,000 times.
    for _ in range(1000):
        outside = {frozenset({name}): float(rng.normal(-45.0, 5.0)) for name in "bcd"}
        inside = {frozenset({"a", str(k)}): float(rng.normal(0.0, 5.0)) for k in range(20)}
        posterior = Posterior((Hypothesis((), 0.0),), {**outside, **inside})
        assert posterior.probability(("a",)) <= 1.0


def test_one_of_two_is_there_and_what_is_beside_them_is_no_alternative() -> None:
    posterior = posterior_of({"ac": 0.6, "bc": 0.38, "c": 0.02})
    found = alternatives(posterior)
    assert found.ambiguity("a") == ("b",)
    assert found.ambiguity("b") == ("a",)
    assert posterior.probability("c") > EVEN


def test_nothing_is_made_sure_by_what_is_not_there() -> None:
    found = alternatives(posterior_of({"a": 0.5, "": 0.4, "b": 0.1}))
    assert found.ambiguity("a") == ()


def test_combinations_stand_out_by_their_eigenvalues() -> None:
    products = np.array([[4.0, 0.0], [0.0, 9.0]])
    assert standing_out(products, np.array([10.0, 1.0])) == pytest.approx([3.0, 20.0])


@pytest.mark.parametrize(
    "significances",
    [(4.8, 5.1), (3.2, 6.4), (0.0, 0.1, 0.2, 1.4, 7.5, 8.4, 8.7, 8.7), (2.0, 4.0), (4.9,)],
)
def test_what_would_show_stands_out_along_most_directions(rng, significances):
    """Effects of plausible rms along random directions, drawn: at least half of them are five standard deviations long."""
    along = rng.normal(size=(20_000, len(significances)))
    along /= np.sqrt(np.mean(along**2, axis=1, keepdims=True))
    seen = np.mean(np.linalg.norm(along * significances, axis=1) >= OUT)
    assert would_show(np.array(significances)) is bool(seen >= 0.5)


def test_an_effect_that_a_named_cause_has_among_its_forms_is_that_cause(rng) -> None:
    """The angle between two effects beside the base, from their columns, against what the formula may be off by."""
    base, effects = rng.normal(size=(60, 3)), rng.normal(size=(60, 4))
    effects[:, 1] = 2.0 * effects[:, 0] + 0.3 * effects[:, 1] + base[:, 0]
    dense = Dense(base, effects, np.zeros(60), 0.1)
    one, other = dense.columns[:, 0], dense.columns[:, 1]
    apart = float(np.sqrt(1.0 - (one @ other) ** 2 / (one @ one) / (other @ other)))
    assert 0.05 < apart < 0.3
    nameless = [variant(1), variant(1, 2)]
    for share, expected in ((1.01 * apart, [True, False]), (0.99 * apart, [False, False]), (0.0, [False, False])):
        found = named_already(dense.comparison(), nameless, [rough(share, 0), rough(share, 3), rough(share, 0, 3)])
        assert found == expected
    assert named_already(dense.comparison(), nameless, []) == [False, False]


def test_a_shift_in_space_that_a_named_cause_has_among_its_forms_is_that_cause(rng):
    base, effects = rng.normal(size=(60, 3)), rng.normal(size=(60, 9))
    effects[:, 3:6] = effects[:, :3] @ rng.normal(size=(3, 3)) + 0.2 * effects[:, 3:6] + base @ rng.normal(size=(3, 3))
    dense = Dense(base, effects, np.zeros(60), 0.1)
    one, other = dense.columns[:, 3:6], dense.columns[:, :3]
    left = one - other @ np.linalg.lstsq(other, one, rcond=None)[0]
    apart = float(np.linalg.norm(left) / np.linalg.norm(one))
    assert 0.02 < apart < 0.5
    nameless = [variant(3, 4, 5), variant(6, 7, 8)]
    for share, expected in ((1.01 * apart, [True, False]), (0.99 * apart, [False, False])):
        assert named_already(dense.comparison(), nameless, [rough(share, 0, 1, 2)]) == expected
