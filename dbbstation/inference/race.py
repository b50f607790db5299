"""Candidate terms compared on what a base model leaves: log evidence, amplitudes, combinations.

All columns of base and candidates are compressed once. Then the base, whose values are fitted anew with every
combination, is eliminated once: what remains is a triangle of the candidates alone, on which any combination costs
microseconds and is still exact. Amplitudes have Gaussian priors of their plausible size, so that flexibility is
punished by the evidence itself [MacKay, Bayesian interpolation, Neural Computation 4 (1992), eq 2.5 and 4.1].
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from dbbstation.inference.square_root import free_directions, spread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.square_root import Block, Columns


PAIRED = 8
"""Best single candidates of which all pairs are tried."""


AS_GOOD = 5.0
"""Difference in log evidence below which one candidate explains measurements about as well as another."""


INDEPENDENT = 1e-9
"""Share of the largest column by which another must differ from the others to explain anything itself."""

FURTHER = 1.5
"""Log evidence that each candidate more must bring beyond what the one before it must: one cause is likelier than two, and what
is not quite as a first one's formula says calls for a second."""


@dataclass(frozen=True, eq=False)
class Variant:
    """One form of a candidate: columns with priors, and the values of shape that they were made with.

    Attributes:
        columns: of the whole problem, shape (p,).
        prior: standard deviation of each amplitude, shape (p,).
        shape: values of the shape parameters, for reports.
    """

    columns: NDArray[np.int64]
    prior: NDArray[np.float64]
    shape: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Candidate:
    """Something that the base model may lack; its variants share the prior probability equally.

    Attributes:
        name: of it.
        variants: its forms.
    """

    name: str
    variants: tuple[Variant, ...]


@dataclass(frozen=True, eq=False)
class Choice:
    """A candidate with the variant that fits best in a combination."""

    candidate: Candidate
    variant: Variant


@dataclass(frozen=True, eq=False)
class Amplitudes:
    """Amplitudes of a combination: values and covariance in the order of the choices' columns."""

    values: NDArray[np.float64]
    covariance: NDArray[np.float64]


@dataclass(eq=False)
class Race:
    """Candidates on what a base model leaves; `race_on` makes it.

    Attributes:
        left: triangle of the candidates' columns and of what is to be explained, last, the base eliminated, weighted.
        first: number of the first candidates' column.
    """

    left: NDArray[np.float64]
    first: int
    _last: tuple[tuple[bytes, bytes], tuple[Race, float]] | None = field(default=None, repr=False)

    @property
    def chi2(self) -> float:
        """Weighted sum of squares that the base leaves."""
        return float(self.left[:, -1] @ self.left[:, -1])

    def evidence(self, variants: Sequence[Variant]) -> float:
        """Log evidence of base and variants over that of the base alone."""
        if not variants:
            return 0.0
        prior = np.concatenate([variant.prior for variant in variants])
        triangle, chi2 = self._solved(variants)
        occam = np.log(np.abs(np.diag(triangle))).sum() + np.log(prior).sum()
        return 0.5 * (self.chi2 - chi2) - float(occam)

    def explained(self, variants: Sequence[Variant]) -> float:
        """Weighted sum of squares that variants take out of what the base leaves, without their priors."""
        columns = self.left[:, np.concatenate([v.columns for v in variants]) - self.first]
        # Pivoted QR: the divide and conquer behind NumPy's lstsq gives up on some finite columns.
        axes, triangle, _ = qr(columns, mode="economic", pivoting=True)
        size = np.abs(np.diag(triangle))
        return float(np.sum((axes[:, size > INDEPENDENT * size[0]].T @ self.left[:, -1]) ** 2))

    def amplitudes(self, variants: Sequence[Variant]) -> Amplitudes:
        """Most probable amplitudes of a combination, and their covariance."""
        columns = np.concatenate([v.columns for v in variants]) - self.first
        prior = np.concatenate([v.prior for v in variants])
        stacked = np.vstack([self.left[:, columns], np.diag(1.0 / prior)])
        target = np.concatenate([self.left[:, -1], np.zeros(len(prior))])
        inverse = np.linalg.pinv(stacked)
        return Amplitudes(inverse @ target, np.asarray(inverse @ inverse.T, dtype=np.float64))

    def visible(self, variant: Variant) -> NDArray[np.float64]:
        """How far plausible amplitudes stand out of what the measurement leaves uncertain, most visible first, (p,).

        Singular values of the signature in units of plausible sizes, the base fitted: along each direction of the
        amplitudes the plausible size over its standard deviation.
        """
        columns = self.left[:, variant.columns - self.first] * variant.prior
        return np.asarray(np.linalg.svd(columns, compute_uv=False), dtype=np.float64)

    def best_variant(self, candidate: Candidate, others: Sequence[Variant]) -> tuple[Variant, float]:
        """Best form of a candidate beside others, and the log evidence of all its forms together."""
        rest, beside = self._beside(others)
        gains = np.array([rest.gain(variant) for variant in candidate.variants])
        return candidate.variants[int(gains.argmax())], beside + together(gains)

    def gain(self, variant: Variant) -> float:
        """Log evidence of base and one variant over that of the base alone."""
        columns = self.left[:, variant.columns - self.first] * variant.prior
        seen, axes = np.linalg.eigh(columns.T @ columns)
        along = (axes.T @ (columns.T @ self.left[:, -1])) ** 2
        information = 1.0 + np.maximum(seen, 0.0)
        return float(0.5 * np.sum(along / information - np.log(information)))

    def _beside(self, variants: Sequence[Variant]) -> tuple[Race, float]:
        """Race on what base and variants leave, these in any size that their priors allow, and their log evidence."""
        if not variants:
            return self, 0.0
        columns = np.concatenate([v.columns for v in variants])
        prior = np.concatenate([v.prior for v in variants])
        key = (columns.tobytes(), prior.tobytes())
        # All candidates are asked for beside the same others, one after the other.
        if self._last is None or self._last[0] != key:
            rest = Race(_eliminated(self.left[:, columns - self.first], prior, self.left), self.first)
            self._last = key, (rest, self.evidence(variants))
        return self._last[1]

    def _solved(self, variants: Sequence[Variant]) -> tuple[NDArray[np.float64], float]:
        columns = np.concatenate([v.columns for v in variants]) - self.first
        prior = np.concatenate([v.prior for v in variants])
        size = len(columns)
        stacked = np.zeros((len(self.left) + size, size + 1))
        stacked[: len(self.left), :size] = self.left[:, columns]
        stacked[: len(self.left), -1] = self.left[:, -1]
        stacked[len(self.left) :, :size] = np.diag(1.0 / prior)
        (factor,) = qr(stacked, mode="r")
        triangle = np.asarray(factor, dtype=np.float64)
        return triangle[:size, :size], float(triangle[size, -1] ** 2)


def race_on(blocks: Sequence[Block], base: Columns, held: NDArray[np.float64], columns: int, noise: float) -> Race:
    """Eliminate the base once.

    Args:
        blocks: compressed runs over all columns, base first.
        base: what is known of the base columns.
        held: orthonormal rows of fitted base directions that the fit kept at zero, in units of the scales. They have
            their usual size here: where it is seen at all, as the curvature of a model lets it be beside very little
            noise, it is no sign of a candidate.
        columns: number of all columns.
        noise: standard deviation of one measurement, where a block does not state its own.
    """
    count = len(base.prior)
    whole = _whole(blocks, columns, noise)
    random, fitted = np.flatnonzero(base.random), np.flatnonzero(~base.random)
    free = free_directions(base, fitted, held)
    along = base.scale[fitted][:, None] * held.T
    eliminated = np.hstack([whole[:, random], whole[:, fitted] @ along, whole[:, fitted] @ free])
    sizes = np.concatenate([base.prior[random], np.ones(len(held))])
    return Race(_eliminated(eliminated, sizes, whole[:, count:])[: columns - count + 1], count)


def _eliminated(
    known: NDArray[np.float64], sizes: NDArray[np.float64], rest: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Triangle of what is left of columns beside others, of which the first have sizes and the further ones are free."""
    stacked = np.hstack([known, rest])
    priors = np.zeros((len(sizes), stacked.shape[1]))
    np.fill_diagonal(priors, 1.0 / sizes)
    (triangle,) = qr(np.vstack([stacked, priors]), mode="r")
    skip = known.shape[1]
    return np.asarray(triangle, dtype=np.float64)[skip:, skip:]


def together(gains: NDArray[np.float64]) -> float:
    """Log of the mean evidence of forms that are as likely."""
    top = float(gains.max())
    return top + float(np.log(np.mean(np.exp(gains - top))))


def select(race: Race, candidates: Sequence[Candidate], threshold: float, most: int) -> list[Choice]:
    """Best combination of candidates, grown and pruned one at a time, but begun with the best pair where that is better.

    Two effects may hide each other so that neither helps alone.

    Args:
        race: what the base leaves.
        candidates: to choose from.
        threshold: log evidence that a candidate must bring; `FURTHER` more for each that there is already.
        most: candidates at the most.
    """
    chosen: list[Choice] = []
    while len(chosen) < most:
        others = [choice.variant for choice in chosen]
        before = race.evidence(others)
        names = {choice.candidate.name for choice in chosen}
        trials = [(c, *race.best_variant(c, others)) for c in candidates if c.name not in names]
        if not trials:
            break
        candidate, variant, evidence = max(trials, key=lambda trial: trial[2])
        enough = _price(threshold, len(chosen), len(chosen) + 1)
        step = [] if evidence - before < enough else [Choice(candidate, variant)]
        if not chosen and most > 1:
            step = _best_pair(race, trials, step, threshold)
        if not step:
            break
        grown = _pruned(race, _settled(race, [*chosen, *step]), threshold)
        # Pruning may undo the step or lead back; only what explains more is a step, so that this comes to an end.
        if race.evidence([choice.variant for choice in grown]) <= before:
            break
        chosen = grown
    return chosen


def _price(threshold: float, have: int, more: int) -> float:
    """Log evidence that candidates must bring to be so many where there were fewer."""
    return sum(threshold + FURTHER * k for k in range(have, more))


def _best_pair(
    race: Race, trials: Sequence[tuple[Candidate, Variant, float]], single: list[Choice], threshold: float
) -> list[Choice]:
    """Return the best pair among the best singles, or the single, where no pair is worth a second name more."""
    best, evidence = single, race.evidence([choice.variant for choice in single])
    leading = sorted(trials, key=lambda trial: -trial[2])[:PAIRED]
    for k, (first, first_variant, _) in enumerate(leading):
        for second, second_variant, _ in leading[k + 1 :]:
            both = race.evidence([first_variant, second_variant])
            if both - evidence > _price(threshold, len(best), 2):
                best, evidence = [Choice(first, first_variant), Choice(second, second_variant)], both
    return best


def _pruned(race: Race, chosen: list[Choice], threshold: float) -> list[Choice]:
    """Choices without those that are not worth it beside the others, the least worthy first."""
    while chosen:
        worth = [worth_of(race, chosen, one) for one in chosen]
        least = int(np.argmin(worth))
        if worth[least] >= _price(threshold, len(chosen) - 1, len(chosen)):
            break
        chosen = [one for k, one in enumerate(chosen) if k != least]
    return chosen


def worth_of(race: Race, chosen: Sequence[Choice], one: Choice) -> float:
    """Log evidence that one of the chosen brings beside the others."""
    others = [c.variant for c in chosen if c is not one]
    return race.best_variant(one.candidate, others)[1] - race.evidence(others)


def _settled(race: Race, chosen: list[Choice]) -> list[Choice]:
    """Every choice in the form that fits best beside the others."""
    for k, choice in enumerate(chosen):
        others = [c.variant for i, c in enumerate(chosen) if i != k]
        variant, _ = race.best_variant(choice.candidate, others)
        chosen[k] = Choice(choice.candidate, variant)
    return chosen


def _whole(blocks: Sequence[Block], columns: int, noise: float) -> NDArray[np.float64]:
    """One triangle of all blocks, target last, weighted by their noise."""
    (triangle,) = qr(spread(blocks, columns, noise), mode="r", overwrite_a=True)
    return np.asarray(triangle, dtype=np.float64)[: columns + 1]
