"""Forms that are added one by one, left out and given up, by dense covariances of all of them [Rasmussen and Williams, 2.19]."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from dbbstation.quality.forms import SIZES, Forms, RunForm
from dbbstation.trace.expected import COEFFICIENTS

N = COEFFICIENTS
HELD = [(object(),) for _ in range(7)]


def drawn() -> dict[int, RunForm]:
    """Seven runs of four tests: the machine, a bar that all share, a ball by test and what each run has alone; all drift."""
    rng = np.random.default_rng(2)
    found = {}
    for k, held in enumerate(HELD):
        effects = {("machine", ""): rng.normal(0.0, 30.0, (N, 5)), ("bar", "1"): rng.normal(0.0, 9.0, (N, 2))}
        effects |= {
            ("ball", str(k // 2)): rng.normal(0.0, 20.0, (N, 3)),
            ("start", str(k)): rng.normal(0.0, 2.0, (N, 1)),
        }
        own = rng.uniform(0.2, 2.0, N)
        found[id(held[0])] = RunForm(
            effects, own, rng.normal(0.0, 20.0, (N, 2)), 60.0 * k, float(rng.uniform(0.0, 0.1))
        )
    return found


FORMS = drawn()


def dense(runs, size: float, rate: float) -> np.ndarray:
    """Covariance of forms, block by block: causes that two runs share are those of one name."""
    blocks = []
    for one in runs:
        row = []
        for other in runs:
            shared = np.diag(one.own_um**2) if one is other else np.zeros((N, N))
            for key, effect in one.effects_um.items():
                if key in other.effects_um:
                    shared = shared + (size if not key[1] else 1.0) ** 2 * effect @ other.effects_um[key].T
            shared[0, 0] += rate**2 * one.started_s * other.started_s
            row.append(shared)
        blocks.append(row)
    return np.block(blocks)


def rate_of(runs) -> float:
    return float(np.sqrt(np.mean([one.drift_um_s**2 for one in runs])))


def forms_held(numbers) -> Forms:
    forms = Forms(lambda held: FORMS[id(held[0])])
    forms.hold([HELD[k] for k in (3, 1, 0)])  # others, of which none but the first is left
    forms.hold([HELD[k] for k in numbers])
    return forms


@pytest.mark.parametrize("kept", [(3, 2, 6, 0, 5, 4, 1), (3, 6, 4), (2,)])
def test_likelihoods_are_those_of_dense_covariances(kept) -> None:
    part = forms_held((3, 2, 6, 0, 5, 4, 1)).part([HELD[k] for k in kept])
    runs = [FORMS[id(HELD[k][0])] for k in kept]
    units = 2.0 * np.sum(np.log([one.own_um for one in runs])) + N * len(runs) * np.log(2.0 * np.pi)
    for size, found in zip(SIZES, part.log_likelihoods(), strict=True):
        covariance = dense(runs, float(size), rate_of(runs))
        for column in range(2):
            off = np.concatenate([one.off_um[:, column] for one in runs])
            true = multivariate_normal.logpdf(off, cov=covariance)
            assert found[column] - 0.5 * units == pytest.approx(true, rel=1e-9)


def test_a_run_left_out_is_where_the_conditional_mean_of_dense_covariances_has_it() -> None:
    order, kept, judged = (3, 2, 6, 0, 5, 4, 1), (3, 6, 4, 0), 2
    apart_um, covariance_um2 = forms_held(order).part([HELD[k] for k in kept], HELD[judged]).beside(HELD[judged])
    runs = [FORMS[id(HELD[k][0])] for k in (judged, *kept)]
    off = np.concatenate([one.off_um for one in runs])
    for k, size in enumerate(SIZES):
        whole = dense(runs, float(size), rate_of(runs))
        gain = np.linalg.solve(whole[N:, N:], whole[N:, :N]).T
        assert apart_um[k] == pytest.approx(off[:N] - gain @ off[N:], rel=1e-7, abs=1e-7)
        assert covariance_um2[k] == pytest.approx(whole[:N, :N] - gain @ whole[N:, :N], rel=1e-7, abs=1e-7)


def test_runs_of_the_part_are_as_far_from_the_rest_as_their_conditional_means_say() -> None:
    order, kept, tested = (3, 2, 6, 0, 5, 4, 1), (3, 6, 4, 0, 1), (4, 1)
    forms = forms_held(order)
    part = forms.part([HELD[k] for k in kept])
    runs = [FORMS[id(HELD[k][0])] for k in (*tested, 3, 6, 0)]
    first = N * len(tested)
    off = np.concatenate([one.off_um[:, 0] for one in runs])
    for k, size in enumerate(SIZES):
        whole = dense(runs, float(size), rate_of(runs))
        gain = np.linalg.solve(whole[first:, first:], whole[first:, :first]).T
        apart = off[:first] - gain @ off[first:]
        true = np.sqrt(apart @ np.linalg.solve(whole[:first, :first] - gain @ whole[first:, :first], apart))
        assert part.length_without(k, forms.rows([HELD[j] for j in tested])) == pytest.approx(true, rel=1e-7)
