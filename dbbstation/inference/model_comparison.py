"""Compare missing causes by marginal likelihood.

The model target = base + causes + noise is linear in amplitudes; the base is projected out. Gaussian priors give closed
forms [MacKay, Bayesian interpolation, Neural Computation 4 (1992), eqs 2.5 and 4.1]. The evidence is averaged over
prior sizes and variants. The slack of a variant represents its formula's inaccuracy, proportional to its amplitudes
[Kennedy and O'Hagan 2001; see `model_form`].
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import add, is_, sub
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.linalg import cho_solve
from scipy.linalg.lapack import dtrtri, dtrtrs

from dbbstation.computing.grouped import grouped
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.square_root import slices
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers

SCALES = np.array([0.01, 0.03, 0.1, 0.3, 1.0, 3.0])
"""Prior standard deviations of amplitudes for averaging, in plausible sizes."""

LOG_SCALE_WEIGHTS = np.log([0.19, 0.19, 0.19, 0.19, 0.19, 0.05])
"""Prior probabilities of `SCALES`: log-uniform over two decades up to the plausible size, one in twenty beyond."""

NO_SLACK, NO_COLUMNS = np.zeros(0), np.zeros(0, dtype=np.int64)


SLACK_SHARES = ((0.1, 0.1), (0.1, 1.0), (1.0, 1.0))
"""Shares of the stated slack for averaging: of a formula's inaccuracy, and of what its parts may differ by. Some machines
follow a formula ten times better than stated, and unnecessary slack would count against a present cause. Struts that each
follow a formula closely may still wind up over unlike lengths, so the two have their own shares."""

MOST_SLACK = 1.5
"""Largest ratio of amplitudes to the amplitudes of a variant's slack up to which slack grows."""


_Eliminated: TypeAlias = "tuple[Floats, Floats, float]"
"""Cholesky factor, transformed target, log evidence."""

_Group: TypeAlias = "tuple[Integers, Integers, Floats, Floats]"
"""Forms with equal numbers of amplitudes: indices, columns, plausible sizes, and products of columns."""


@dataclass(frozen=True, eq=False)
class Variant:
    """One form of a cause.

    Attributes:
        label: kind or strut; may be empty.
        law: name, if a cause has several.
        whole: columns of the cause's form with all amplitudes, shape (q,); may be empty.
        slack: columns of formula inaccuracy, shape (d,).
        slack_sd: standard deviations of slack at amplitudes `slack_at`, shape (d,).
        slack_at: rms amplitude in plausible sizes.
        tangents: number of first slack columns that are derivatives by nonlinear parameters.
        parts: number of last slack columns that are differences between parts of one law, such as struts.
        positive: amplitudes that cannot be negative, shape (p,); may be empty.
        form_uncertainty: relative inaccuracy of the formula.
    """

    columns: Integers
    plausible: Floats
    nonlinear: tuple[float, ...] = ()
    label: str = ""
    law: str = ""
    whole: Integers = field(default_factory=lambda: NO_COLUMNS)
    log_weight: float = 0.0
    slack: Integers = field(default_factory=lambda: NO_COLUMNS)
    slack_sd: Floats = field(default_factory=lambda: NO_SLACK)
    slack_at: float = 1.0
    tangents: int = 0
    parts: int = 0
    positive: tuple[bool, ...] = ()
    form_uncertainty: float = 0.0


@dataclass(frozen=True, eq=False)
class Cause:
    """An effect that the base model may lack.

    Attributes:
        variants: alternative forms, with weights that sum to one.
        named: True for a physical cause, False for unmodelled effects and set-up faults.
    """

    name: str
    variants: tuple[Variant, ...]
    log_prior_odds: float
    named: bool = True
    setup: bool = False

    @property
    def widest(self) -> Variant:
        """Return the form with most amplitudes."""
        return max(self.variants, key=lambda one: len(one.columns))


@dataclass(frozen=True, eq=False)
class Member:
    """A cause in a hypothesis, with best variant and size.

    Attributes:
        scale: prior standard deviation in plausible sizes.
        slack_share: share of the stated slack, which `slack_scale` contains.
        parts_share: that of differences between parts.
    """

    cause: Cause
    variant: Variant
    scale: float
    slack_scale: float = 1.0
    slack_share: float = 1.0
    parts_share: float = 1.0

    @property
    def name(self) -> str:
        """Return its cause's name."""
        return self.cause.name

    @property
    def width(self) -> int:
        """Return its number of amplitudes."""
        return len(self.variant.columns)

    @property
    def log_odds(self) -> float:
        """Return the log prior odds of its cause, with the weight of its form."""
        return self.cause.log_prior_odds + self.variant.log_weight

    @cached_property
    def columns(self) -> Integers:
        """Return columns of amplitudes, then slack."""
        return np.concatenate([self.variant.columns, self.variant.slack])

    @cached_property
    def sd(self) -> Floats:
        """Return prior standard deviations."""
        slack = self.variant.slack_sd * self.slack_scale
        # A formula closer than stated does not reduce the prior of parameters.
        slack[: self.variant.tangents] /= self.slack_share
        slack[len(slack) - self.variant.parts :] *= self.parts_share / self.slack_share
        return np.concatenate([self.variant.plausible * self.scale, slack])


@dataclass(frozen=True, eq=False)
class Scan:
    """Bayes factors of causes, given a hypothesis.

    Attributes:
        log_factor: averaged log Bayes factors, shape (c,).
        factors: log Bayes factors by form and size, shape (m, s).
    """

    causes: tuple[Cause, ...]
    log_factor: Floats
    factors: Floats
    weighted: Floats
    first: Integers
    last: Integers
    slim: tuple[list[int], ...]

    @cached_property
    def log_odds(self) -> Floats:
        """Return the causes' log odds, shape (c,)."""
        return self.log_factor + np.array([cause.log_prior_odds for cause in self.causes])

    def best_of(self, k: int) -> Member:
        """Return a cause as member with best variant and scale."""
        form, scale = self._best(k)
        return Member(self.causes[k], self.causes[k].variants[form], float(SCALES[scale]))

    @cached_property
    def best(self) -> tuple[Member, ...]:
        """Return each cause as member with best variant and scale."""
        return tuple(self.best_of(k) for k in range(len(self.causes)))

    @cached_property
    def log_best(self) -> Floats:
        """Return each cause's best log Bayes factor without weights, shape (c,)."""
        best = (self._best(k) for k in range(len(self.causes)))
        return np.array([self.factors[self.first[k] + form, scale] for k, (form, scale) in enumerate(best)])

    @cached_property
    def narrow(self) -> tuple[Member | None, ...]:
        """Return each cause's best inflexible variant; None if equal to `best` or missing."""
        return tuple(self._narrow(k) for k in range(len(self.causes)))

    def of(self, kept: Sequence[int]) -> Scan:
        """Return the scan of only these causes."""
        numbers = np.array(kept, dtype=np.int64)
        return replace(
            self,
            causes=tuple(self.causes[k] for k in kept),
            slim=tuple(self.slim[k] for k in kept),
            log_factor=self.log_factor[numbers],
            first=self.first[numbers],
            last=self.last[numbers],
        )

    def _best(self, k: int) -> tuple[int, int]:
        return divmod(int(self.weighted[self.first[k] : self.last[k]].argmax()), len(SCALES))

    def _narrow(self, k: int) -> Member | None:
        slim = self.slim[k]
        if not slim or self._best(k)[0] in slim:
            return None
        each = self.weighted[self.first[k] : self.last[k]]
        slot, size = divmod(int(each[slim].argmax()), len(SCALES))
        return Member(self.causes[k], self.causes[k].variants[slim[slot]], float(SCALES[size]))


@dataclass(frozen=True, eq=False)
class Estimates:
    """Posterior means and covariance of members' columns."""

    values: Floats
    covariance: Floats


class _Forms:
    """Forms of causes by number of amplitudes.

    Attributes:
        needed: columns, shape (q,).
        groups: forms, shape (m,); indices in `needed` and plausible sizes, shape (m, p) each; products, shape (m, p, p).
        weights: log probability of each form within its cause.
    """

    def __init__(self, causes: tuple[Cause, ...], gram: Floats, at: Callable[[Integers], Integers]) -> None:
        forms = [variant for cause in causes for variant in cause.variants]
        self.causes, self.ends = causes, np.cumsum([0, *(len(cause.variants) for cause in causes)])
        self.weights = np.array([form.log_weight for form in forms])
        self.slim = [[k for k, v in enumerate(c.variants) if len(v.columns) < BOUNDS.flexible] for c in causes]
        by_size = grouped((len(form.columns), number) for number, form in enumerate(forms))
        of_sizes = {size: at(np.array([forms[k].columns for k in some])) for size, some in by_size.items()}
        self.needed: Integers = np.unique(np.concatenate([NO_COLUMNS, *(part.ravel() for part in of_sizes.values())]))
        place = np.zeros(len(gram), dtype=np.int64)
        place[self.needed] = np.arange(len(self.needed))
        self.groups: list[_Group] = []
        for size, columns in of_sizes.items():
            plausible = np.array([forms[k].plausible for k in by_size[size]])
            blocks = gram[columns[:, :, None], columns[:, None, :]]
            self.groups.append((np.array(by_size[size]), place[columns], plausible, blocks))


class ModelComparison:
    """Marginal likelihoods over sets of causes.

    Args:
        gram: products with the base projected out, over noise, shape (n, n).
        towards: products with the target, shape (n,).
        evidence: log evidence of causes already in the base.
    """

    def __init__(
        self,
        gram: Floats,
        towards: Floats,
        columns: Integers | None = None,
        evidence: float = 0.0,
    ) -> None:
        self._gram, self._towards = gram, towards
        self._columns, self._evidence = columns, evidence
        self._last: tuple[tuple[Member, ...], _Eliminated] | None = None
        self._forms: dict[str, _Forms] = {}

    def among(self, causes: Iterable[Cause]) -> ModelComparison:
        """Return the comparison of some causes, in contiguous arrays."""
        every = [part for cause in causes for one in cause.variants for part in (one.columns, one.slack)]
        columns = np.unique(np.concatenate([NO_COLUMNS, *every]))
        own = self._at(columns)
        return ModelComparison(_square(self._gram, own), self._towards[own], columns, self._evidence)

    def beside_of(self, member: Member) -> ModelComparison:
        """Return the comparison with a member in the base."""
        lower, z, evidence = self._eliminated((member,))
        across = self._across((member,), lower, np.arange(len(self._gram)))
        return ModelComparison(self._gram - across.T @ across, self._towards - across.T @ z, self._columns, evidence)

    def _across(self, members: Sequence[Member], lower: Floats, places: Integers) -> Floats:
        """Return the members' inverse Cholesky factor times their products with columns, shape (p, q)."""
        if not members:
            return np.zeros((0, len(places)))
        taken, sd = _stacked(members)
        products = self._gram[np.ix_(places, self._at(taken))]  # contiguous in the solver's order
        products *= sd
        return _solved(lower, products.T)

    def _at(self, columns: Integers) -> Integers:
        return columns if self._columns is None else np.searchsorted(self._columns, columns)

    def log_evidence(self, members: Sequence[Member]) -> float:
        """Return the members' log marginal likelihood, relative to the base."""
        return self._eliminated(members)[2]

    def explained(self, members: Sequence[Member]) -> float:
        """Return the penalised chi-square reduction."""
        _, z, _ = self._eliminated(members)
        return float(z @ z)

    def values(self, members: Sequence[Member]) -> Floats:
        """Return posterior means of amplitudes and slack, shape (p,)."""
        lower, z, _ = self._eliminated(members)
        _, sd = _stacked(members)
        return sd * _solved(lower, z, transposed=True)

    def estimates(self, members: Sequence[Member]) -> Estimates:
        """Return posterior means and covariance of members' amplitudes and slack."""
        columns, sd = _stacked(members)
        information = self._information(columns, sd)
        factor = cholesky(information)
        values = cho_solve((factor, True), sd * self._towards[self._at(columns)])
        inverse = cho_solve((factor, True), np.eye(len(sd)))
        return Estimates(sd * values, sd[:, None] * inverse * sd)

    def estimated(self, members: Sequence[Member]) -> list[tuple[Member, Floats, Floats]]:
        """Return each member with the posterior means and covariance of its columns, fitted together."""
        found = self.estimates(members)
        every = zip(members, slices_of(members), strict=True)
        return [(member, found.values[own], found.covariance[own, own]) for member, own in every]

    def beside(self, members: Sequence[Member], columns: Integers) -> Floats:
        """Return products of columns with base and members projected out, shape (p, p)."""
        columns = self._at(columns)
        own = _square(self._gram, columns)
        if not members:
            return own
        lower, _, _ = self._eliminated(members)
        across = self._across(members, lower, columns)
        return own - across.T @ across

    def log_evidence_of_pairs(self, members: Sequence[Member], more: Sequence[Member]) -> tuple[Integers, Floats]:
        """Return every pair of causes, shape (c, 2), and the members' log marginal likelihood with it, without its slack."""
        lower, z, evidence = self._eliminated(members)
        columns = self._at(all_columns(m.variant for m in more))
        sd = np.concatenate([NO_SLACK, *(m.variant.plausible * m.scale for m in more)])
        towards = self._towards[columns]
        gram = _square(self._gram, columns)
        if members:
            across = self._across(members, lower, columns)
            gram, towards = gram - across.T @ across, towards - across.T @ z
        information, along = sd[:, None] * gram * sd + np.eye(len(sd)), sd * towards
        widths = np.array([m.width for m in more], dtype=np.int64)
        starts = np.cumsum([0, *widths])
        every = np.column_stack(np.triu_indices(len(more), 1))
        found = np.zeros(len(every))
        for first, second in set(map(tuple, widths[every].tolist())):
            # Pairs with equal numbers of amplitudes are computed together.
            same = np.flatnonzero((widths[every] == (first, second)).all(axis=1))
            a, b = starts[every[same]].T
            own = np.hstack([a[:, None] + np.arange(first), b[:, None] + np.arange(second)])
            halves = _factors(information[own[:, :, None], own[:, None, :]])
            w = np.linalg.solve(halves, along[own][:, :, None])[:, :, 0]
            squares = 0.5 * np.square(w).sum(axis=1)
            found[same] = evidence + squares - np.log(np.diagonal(halves, axis1=1, axis2=2)).sum(axis=1)
        return every, found

    def scan(self, members: Sequence[Member], causes: Iterable[Cause]) -> Scan:
        """Scan every cause given members, over variants and sizes."""
        return self.around(members, causes).scan()

    def around(self, members: Sequence[Member], causes: Iterable[Cause]) -> Around:
        """Return scans of every cause given all members but a few, by one elimination."""
        forms = self._forms_of(tuple(causes))
        lower, z, evidence = self._eliminated(members)
        across = self._across(members, lower, forms.needed)
        towards = self._towards[forms.needed] - across.T @ z
        return Around(tuple(members), forms, lower, z, evidence, across, towards)

    def each_beside_others(
        self, members: Sequence[Member], which: Sequence[int] | None = None
    ) -> list[tuple[Member, float, float]]:
        """Scan each member's present variant given the other members, without slack, over all sizes.

        Args:
            which: places of the members to scan; None for all.

        Returns:
            Per scanned member: the member with its best size, the log Bayes factor averaged over sizes with the
            variant's weight, and the log Bayes factor of the best size without weights.
        """
        # The inverse of a block of A's inverse is the block's information given the others [Schur complement; Horn and
        # Johnson, Matrix Analysis, 2nd ed., sec. 0.7.3].
        lower, z, _ = self._eliminated(members)
        inverse, places = _inverse_of(lower), slices_of(members)
        found = []
        for k in range(len(members)) if which is None else which:
            member, first = members[k], places[k].start
            own = inverse[first:, first : first + member.width]
            variance, axes = np.linalg.eigh(own.T @ own)
            if variance[0] <= 0.0:
                raise np.linalg.LinAlgError("rounding hides the smallest variance")
            information = 1.0 / variance
            along = np.square(information * (axes.T @ (own.T @ z[first:]))) / member.scale**2
            seen = np.maximum(information - 1.0, 0.0) / member.scale**2
            factors = _log_factors(seen[None], along[None])[0]
            weighted = factors + LOG_SCALE_WEIGHTS + member.variant.log_weight
            best = int(weighted.argmax())
            averaged = float(weighted[best] + np.log(np.exp(weighted - weighted[best]).sum()))
            found.append((replace(member, scale=float(SCALES[best])), averaged, float(factors[best])))
        return found

    def _information(self, columns: Integers, sd: Floats) -> Floats:
        own = self._at(columns)
        information = _square(self._gram, own)
        information *= sd[:, None]
        information *= sd
        information.flat[:: len(sd) + 1] += 1.0
        return information

    def _forms_of(self, causes: tuple[Cause, ...]) -> _Forms:
        key = causes[0].name if len(causes) == 1 else ""
        known = self._forms.get(key)
        if known is None or list(map(id, known.causes)) != list(map(id, causes)):
            known = self._forms[key] = _Forms(causes, self._gram, self._at)
        return known

    def _eliminated(self, members: Sequence[Member]) -> _Eliminated:
        if not members:
            return np.zeros((0, 0)), np.zeros(0), self._evidence
        # A search scans given a set, then immediately requests the evidence of this set.
        if self._last is not None and len(self._last[0]) == len(members) and all(map(is_, self._last[0], members)):
            return self._last[1]
        columns, sd = _stacked(members)
        information = self._information(columns, sd)
        lower = cholesky(information)
        z = _solved(lower, sd * self._towards[self._at(columns)])
        found = lower, z, self._evidence + 0.5 * float(z @ z) - float(np.log(np.diag(lower)).sum())
        self._last = tuple(members), found
        return found


def _scanned(forms: _Forms, towards: Floats, left: Sequence[Floats]) -> Scan:
    factors = np.empty((len(forms.weights), len(SCALES)))
    for (numbers, own, plausible, _), products in zip(forms.groups, left, strict=True):
        blocks, ahead = plausible[:, :, None] * products * plausible[:, None, :], plausible * towards[own]
        if blocks.shape[-1] >= BOUNDS.wide:
            factors[numbers] = [_factored(*each) for each in zip(blocks, ahead, strict=True)]
            continue
        seen, axes = np.linalg.eigh(blocks)
        along = np.square(np.einsum("mpq,mp->mq", axes, ahead))
        factors[numbers] = _log_factors(np.maximum(seen, 0.0), along)
    weighted = factors + forms.weights[:, None] + LOG_SCALE_WEIGHTS
    first, last = forms.ends[:-1], forms.ends[1:]
    log_factor = np.zeros(0)
    if len(first):
        top = np.maximum.reduceat(weighted.max(axis=1), first)
        above = np.exp(weighted - np.repeat(top, last - first)[:, None]).sum(axis=1)
        log_factor = top + np.log(np.add.reduceat(above, first))
    return Scan(forms.causes, log_factor, factors, weighted, first, last, tuple(forms.slim))


@dataclass(frozen=True, eq=False)
class Around:
    """Scans of causes given a hypothesis without some members.

    A is the members' information, P its inverse, C the products with a cause, R the rows k of P C. Members without
    columns k absorb C^T P C - R^T (P_kk)^-1 R [Schur complement; Horn and Johnson, Matrix Analysis, 2nd ed., sec.
    0.7.3].
    """

    members: tuple[Member, ...]
    forms: _Forms
    lower: Floats
    z: Floats
    evidence: float
    across: Floats
    towards: Floats

    @cached_property
    def _left(self) -> list[Floats]:
        products = [products for _, _, _, products in self.forms.groups]
        return _combined(sub, products, self.forms, self.across) if self.members else products

    @cached_property
    def _turned(self) -> tuple[Floats, Floats, Floats]:
        rows, values = (_solved(self.lower, right, transposed=True) for right in (self.across, self.z))
        return rows, values, _inverse_of(self.lower)

    def scan(self) -> Scan:
        """Return the scan given all members."""
        return _scanned(self.forms, self.towards, self._left)

    def without(self, names: Collection[str]) -> tuple[Scan, float]:
        """Return the scan given all members but some, and the remaining members' log evidence."""
        if not names:
            return self._of_absent(self.scan(), names), self.evidence
        every, towards, inverse = self._turned
        own = np.flatnonzero(belong_to(self.members, names))
        # A root of P_kk, computed without squaring the information.
        root = np.asarray(np.linalg.qr(inverse[:, own], mode="r"), dtype=np.float64).T
        rows, values = _solved(root, every[own]), _solved(root, towards[own])
        left = _combined(add, self._left, self.forms, rows)
        scan = _scanned(self.forms, self.towards + rows.T @ values, left)
        evidence = self.evidence - 0.5 * float(values @ values) - float(np.log(np.abs(np.diag(root))).sum())
        return self._of_absent(scan, names), evidence

    def _of_absent(self, scan: Scan, names: Collection[str]) -> Scan:
        there = {m.name for m in self.members} - set(names)
        return scan.of([k for k, cause in enumerate(scan.causes) if cause.name not in there])


def _combined(
    how: Callable[[Floats, Floats], Floats], products: list[Floats], forms: _Forms, rows: Floats
) -> list[Floats]:
    """Return products of each group's forms, plus or minus the products of these rows, shape (p, q)."""
    own = (rows.T[columns] for _, columns, _, _ in forms.groups)
    return [how(one, each @ each.transpose(0, 2, 1)) for one, each in zip(products, own, strict=True)]


def belong_to(members: Sequence[Member], names: Collection[str]) -> Flags:
    """Return which columns belong to the named members, shape (p,)."""
    return np.concatenate([np.full(len(m.columns), m.name in names) for m in members])


def _square(gram: Floats, own: Integers) -> Floats:
    return gram.take(own, axis=0).take(own, axis=1)  # in half the time of one selection of both


def _solved(lower: Floats, right: Floats, *, transposed: bool = False) -> Floats:
    if not len(lower):
        return right
    found, info = dtrtrs(np.asarray(lower, order="C").T, right, lower=0, trans=0 if transposed else 1)
    if info:
        raise np.linalg.LinAlgError("singular triangle")
    return found


def _inverse_of(lower: Floats) -> Floats:
    found, info = dtrtri(np.asarray(lower, order="C").T, lower=0)
    if info:
        raise np.linalg.LinAlgError("singular triangle")
    return np.asarray(found.T, dtype=np.float64)


def _factors(information: Floats) -> Floats:
    """Return several Cholesky factors, shape (k, p, p), as by `cholesky`."""
    try:
        return np.asarray(np.linalg.cholesky(information), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.stack([cholesky(one) for one in information])


def cholesky(information: Floats) -> Floats:
    """Return the Cholesky factor of information in units of the prior, shape (p, p).

    All eigenvalues are at least one; eigenvalues below, by rounding, are set to one.
    """
    try:
        return np.asarray(np.linalg.cholesky(information), dtype=np.float64)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(information)
        upper = np.linalg.qr((vectors * np.sqrt(np.maximum(values, 1.0))).T, mode="r")
        return (upper * np.sign(np.diag(upper))[:, None]).T


def with_slack_of(member: Member, values: Floats) -> Member:
    """Return the member with slack for the given amplitudes."""
    if len(member.variant.slack) == 0:
        return member
    size = amplitude_size(member, values)
    return replace(member, slack_scale=member.slack_share * min(size / member.variant.slack_at, MOST_SLACK))


def amplitude_size(member: Member, values: Floats) -> float:
    """Return a member's rms amplitude in plausible sizes."""
    return rms(values / member.variant.plausible)


def _log_factors(seen: Floats, along: Floats) -> Floats:
    squares = SCALES[:, None] ** 2
    information = 1.0 + squares * seen[:, None, :]
    return 0.5 * np.sum(squares * along[:, None, :] / information - np.log(information), axis=2)


def _factored(block: Floats, towards: Floats) -> Floats:
    """Return `_log_factors` of one form, by a factorisation for each size, shape (s,)."""
    found = np.empty(len(SCALES))
    for k, scale in enumerate(SCALES.tolist()):
        lower = cholesky(scale**2 * block + np.eye(len(block)))
        z = _solved(lower, scale * towards)
        found[k] = 0.5 * float(z @ z) - float(np.log(np.diag(lower)).sum())
    return found


def largest_sd(causes: Iterable[Cause], count: int) -> Floats:
    """Return the largest plausible size of each of `count` columns over all forms of causes; zero for other columns."""
    sd = np.zeros(count)
    for variant in (variant for cause in causes for variant in cause.variants):
        sd[variant.columns] = np.maximum(sd[variant.columns], variant.plausible)
    return sd


def slices_of(members: Sequence[Member], first: int = 0) -> list[slice]:
    """Return each member's place among the columns of all, which begin at `first`."""
    return slices((len(member.columns) for member in members), first)


def all_columns(each: Iterable[Member | Variant]) -> Integers:
    """Return the columns of members, or of forms without slack, shape (p,)."""
    return np.concatenate([NO_COLUMNS, *(one.columns for one in each)])


def _stacked(members: Sequence[Member]) -> tuple[Integers, Floats]:
    return all_columns(members), np.concatenate([NO_SLACK, *(m.sd for m in members)])
