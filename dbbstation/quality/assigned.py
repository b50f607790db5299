"""Which circle of the plan each run shows: all runs of a session together.

A run filed under another circle makes right runs look wrong. Assignments of runs to circles are compared by their
marginal likelihood over the machine's errors, each mistake at its prior probability. A sound session favours another
assignment by f with a probability of at most 1 / f [Markov's inequality].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from dbbstation.quality.finding import Finding, FindingVerdict, Name
from dbbstation.quality.forms import FIRST_COSINE, FIRST_SINE
from dbbstation.quality.forms import SIZES as SHARES
from dbbstation.quality.knowledge import COEFFICIENTS, along_travel
from dbbstation.quality.limits import LOG_ODDS_LIMIT
from dbbstation.quality.stated import limit_along
from dbbstation.quality.together import expected_um, read_um

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import date

    from numpy.typing import ArrayLike, NDArray

    from dbbstation.quality.knowledge import Planned, Seen

MISTAKE = LOG_ODDS_LIMIT
"""What a mistake costs, as a logarithm: an operator makes one in a thousand circles."""

SIZES = np.append(0.0, SHARES)
"""Errors of a machine as shares of their usual size; a simulated machine may have none, and then every circle shows any other equally well."""

WIDE = 3
"""Assignments that are followed at once."""

ELSEWHERE_UM = 1e3
"""Standard deviation of a run that is no circle of the plan, per coefficient: a bar's travel is millimetres [µm]."""

ELSEWHERE, BESIDE, LARGER = -1, -2, -3
"""Labels of such a run, of its own circle about another place, and of its own circle with another radius."""

ANYWHERE_UM = 1e4
"""Standard deviation of a centre that says nothing [µm]."""


@dataclass(frozen=True, eq=False)
class FormerSitting:
    """The last session of machine and plan.

    Attributes:
        read_um: readings along the travel by test and direction, shape (7,) each [µm].
    """

    session: str
    measured: date
    read_um: Mapping[tuple[str, str], NDArray[np.float64]]

    def moved(self, circles: Sequence[Planned]) -> tuple[Planned, ...]:
        """Return circles expected as this session read them."""
        found = []
        for one in circles:
            more = along_travel(one.circle) * (self.read_um[_key(one)] - expected_um(one))
            found.append(replace(one, expected=replace(one.expected, form_um=one.expected.form_um + more)))
        return tuple(found)


class Assigned:
    """Runs of a session and the circles that they may show."""

    def __init__(
        self, circles: Sequence[Planned], runs: Sequence[Seen], reference: FormerSitting | None = None
    ) -> None:
        self.reference = reference
        self.circles = circles if reference is None else reference.moved(circles)
        self.runs = [one for one in runs if one.analysis is not None]
        self._planned = [self._label(one.run.test, one.run.circle.direction) for one in self.runs]
        self._known: dict[tuple[int, ...], float] = {}
        self._products: dict[tuple[int, int], NDArray[np.float64]] = {}

    def _label(self, test: str, direction: str) -> int:
        return next(k for k, one in enumerate(self.circles) if _key(one) == (test, direction))

    def odds(self, one: Seen) -> float:
        """Return the logarithm of the odds against a run's own circle."""
        at, known = self.runs.index(one), self._looked_up
        own = max(score for labels, score in known.items() if labels[at] == self._planned[at])
        others = (score for labels, score in known.items() if labels[at] != self._planned[at])
        return max(others, default=-np.inf) - own

    def finding(self, one: Seen, undecided: Finding) -> Finding:
        """Return a finding on the circle that a run shows, decided by all runs together."""
        against = self.odds(one) + self._cost
        if against > self._cost - 2.0 * LOG_ODDS_LIMIT:
            return undecided
        limit, text = self._cost, f"all {len(self.runs)} circles together show it"
        return Finding(undecided.name, max(against, 0.0), limit, "", FindingVerdict.GOOD, text)

    def suspects(self) -> dict[Seen, Finding]:
        """Return the runs that contradict the others, each with the circle that it shows instead."""
        known = self._looked_up
        floor = known[tuple(self._planned)]
        top = max(known.values())
        likely = [labels for labels, score in known.items() if score > floor and score >= top - LOG_ODDS_LIMIT]
        likely.sort(key=known.__getitem__, reverse=True)
        found = {}
        for at, one in enumerate(self.runs):
            changed = [labels[at] for labels in likely if labels[at] != self._planned[at]]
            if changed:
                # A ball beside its place, where it is as likely, is what is looked after first.
                label = min(changed, key=lambda one: one not in {BESIDE, LARGER})
                found[one] = self._wrong(one, label, certain=len(changed) == len(likely))
        return found

    def _wrong(self, one: Seen, label: int, *, certain: bool) -> Finding:
        value, limit = max(self.odds(one), 0.0) + self._cost, self._cost
        if label < 0:
            name, what = _OTHERWISE[label]
        elif self.circles[label].test == one.run.test:
            name, what = Name.DIRECTION, "it ran the wrong way round"
        else:
            name, what = Name.TEST, f"it is the circle of {self.circles[label].label}"
        short = what if certain else f"either {what}, or a circle that it contradicts is wrong"
        return Finding(
            name, value, limit, "", FindingVerdict.WRONG, f"by all {len(self.runs)} circles together {short}", short
        )

    @property
    def _cost(self) -> float:
        return MISTAKE + float(np.log(len(self.circles)))

    @cached_property
    def _looked_up(self) -> Mapping[tuple[int, ...], float]:
        followed: set[tuple[int, ...]] = set()
        best = [tuple(self._planned)]
        least = self.score(best[0]) - self._cost
        while any(labels not in followed for labels in best):
            for labels in [each for each in best if each not in followed]:
                followed.add(labels)
                self._follow(labels)
            best = sorted(self._known, key=self._known.__getitem__, reverse=True)[:WIDE]
            # One mistake more cannot bring more than it costs where one alone lost as much.
            best = [labels for labels in best if self._known[labels] >= least]
        return self._known

    def _follow(self, labels: tuple[int, ...]) -> None:
        beside = _Beside(self, labels)
        self._known[labels] = beside.log - self._mistakes(labels)
        for runs, instead in self._changes():
            for other, log in zip(instead, beside.changed(runs, instead), strict=True):
                changed = _put(labels, dict(zip(runs, other, strict=True)))
                self._known.setdefault(changed, float(log) - self._mistakes(changed))

    def _changes(self) -> Iterator[tuple[Sequence[int], Sequence[Sequence[int]]]]:
        """Yield runs with other labels: one run, all runs of a mounting, or two exchanged mountings."""
        yield from (([run], [[label] for label in self._everything]) for run in range(len(self.runs)))
        groups = self._groups
        for group in groups:
            tests = dict.fromkeys(one.test for one in self.circles)
            yield group, [each for test in tests if (each := self._as_test(group, test)) is not None]
        for one, other in combinations(groups, 2):
            first = self._as_test(one, self.runs[other[0]].run.test)
            second = self._as_test(other, self.runs[one[0]].run.test)
            if first is not None and second is not None:
                yield [*one, *other], [[*first, *second]]

    @cached_property
    def _everything(self) -> tuple[int, ...]:
        return (*range(len(self.circles)), LARGER, BESIDE, ELSEWHERE)

    @cached_property
    def _groups(self) -> list[list[int]]:
        found: dict[tuple[str, str], list[int]] = {}
        for k, one in enumerate(self.runs):
            found.setdefault((one.run.test, one.run.mounting), []).append(k)
        return list(found.values())

    def _as_test(self, group: Sequence[int], test: str) -> list[int] | None:
        try:
            return [self._label(test, self.runs[k].run.circle.direction) for k in group]
        except StopIteration:
            return None

    def score(self, labels: tuple[int, ...]) -> float:
        """Return the log likelihood of an assignment with its mistakes."""
        if labels not in self._known:
            self._known[labels] = _Beside(self, labels).log - self._mistakes(labels)
        return self._known[labels]

    def _mistakes(self, labels: Sequence[int]) -> float:
        """Return the cost of mistakes; all runs of a mounting under another test count once, as do two exchanged mountings."""
        whole: set[frozenset[str]] = set()
        single = 0
        for group in self._groups:
            changed = [k for k in group if labels[k] != self._planned[k]]
            shown = {self.circles[labels[k]].test if self._same_way(k, labels[k]) else "" for k in changed}
            if len(changed) == len(group) and len(shown) == 1 and "" not in shown:
                whole.add(frozenset({self.runs[group[0]].run.test, *shown}))
            else:
                single += len(changed)
        return self._cost * (len(whole) + single)

    def _same_way(self, run: int, label: int) -> bool:
        return label >= 0 and self.circles[label].circle.direction is self.runs[run].run.circle.direction

    def information(self, labels: Sequence[int]) -> NDArray[np.float64]:
        """Return products of whitened effects and readings, summed over runs, shape (p + 1, p + 1).

        The readings are the last row and column; their own product has the log determinant of the scatter added.
        """
        return np.sum([self._product(run, label) for run, label in enumerate(labels)], axis=0)

    def _product(self, run: int, label: int) -> NDArray[np.float64]:
        if (run, label) not in self._products:
            root = np.linalg.cholesky(self.scatter[run][label])
            read = np.column_stack([self.effects[self.shows(run, label)], self.off[run][label]])
            white = np.linalg.solve(root, read)
            self._products[run, label] = white.T @ white
            self._products[run, label][-1, -1] += 2.0 * _log_diagonal(root)
        return self._products[run, label]

    def shows(self, run: int, labels: ArrayLike) -> NDArray[np.int64]:
        """Return the circles whose effects a run has under labels, the last for no circle."""
        labels = np.asarray(labels)
        own = np.where(labels == ELSEWHERE, len(self.circles), self._planned[run])
        return np.where(labels >= 0, labels, own)

    @cached_property
    def effects(self) -> NDArray[np.float64]:
        """Return effects of shared causes on all circles and on none, shape (l + 1, 7, p) [µm]."""
        columns = np.concatenate([self._of_machine, self._of_session], axis=2)
        return np.concatenate([columns, np.zeros_like(columns[:1])])

    def scale(self, size: float) -> NDArray[np.float64]:
        """Return the standard deviations of shared causes with machine errors of a size, shape (p,)."""
        return np.repeat([size, 1.0], [self._of_machine.shape[2], self._of_session.shape[2]])

    @cached_property
    def off(self) -> list[NDArray[np.float64]]:
        """Return the reading minus expectation by label, shape (l + 3, 7) each [µm]."""
        expected, every = np.array([expected_um(one) for one in self.circles]), range(len(self.circles))
        return [
            read_um(one) - expected[[*every, own, own, own]] for one, own in zip(self.runs, self._planned, strict=True)
        ]

    @cached_property
    def scatter(self) -> list[NDArray[np.float64]]:
        """Return the covariance of each reading's own part by label, shape (l + 3, 7, 7) each [µm²]."""
        found = []
        for one, own in zip(self.runs, self._planned, strict=True):
            by_label = np.array([*self._own, *[self._own[own]] * 3]) + one.u_um**2 * np.eye(COEFFICIENTS)
            by_label[ELSEWHERE] = ELSEWHERE_UM**2 * np.eye(COEFFICIENTS)
            for k in (FIRST_COSINE, FIRST_SINE):
                by_label[BESIDE, k, k] += ELSEWHERE_UM**2
            by_label[LARGER, 0, 0] += ELSEWHERE_UM**2
            found.append(by_label)
        return found

    @cached_property
    def _of_machine(self) -> NDArray[np.float64]:
        """Return effects of the machine's causes on all circles, shape (l, 7, p) [µm]."""
        return self._effects({key for key in self._keys if not key[1]})

    @cached_property
    def _of_session(self) -> NDArray[np.float64]:
        """Return the same of causes common to all circles: the bar, the tool's ball, the plate."""
        return self._effects({key for key in self._shared if key[1]})

    @cached_property
    def _keys(self) -> tuple[tuple[str, str], ...]:
        return tuple(dict.fromkeys(key for one in self.circles for key in one.expected.effects_um))

    @cached_property
    def _shared(self) -> frozenset[tuple[str, str]]:
        keys = [set(one.expected.effects_um) for one in self.circles]
        return frozenset(set.intersection(*keys))

    def _effects(self, wanted: set[tuple[str, str]]) -> NDArray[np.float64]:
        """Return effects of causes on all circles, shape (l, 7, p) [µm]."""
        columns = [np.zeros((COEFFICIENTS * len(self.circles), 0))]
        for key in (key for key in self._keys if key in wanted):
            effects = [one.expected.effects_um.get(key) for one in self.circles]
            wide = max(each.shape[1] for each in effects if each is not None)
            blank = np.zeros((COEFFICIENTS, wide))
            signs = [along_travel(one.circle)[:, None] for one in self.circles]
            blocks = [blank if e is None else sign * e for sign, e in zip(signs, effects, strict=True)]
            columns.append(np.vstack(blocks))
        stacked = np.hstack(columns)
        # As many numbers as the circles have: rotated so that the rest is zero.
        u, sizes, _ = np.linalg.svd(stacked, full_matrices=False)
        kept = sizes > 1e-6 * max(float(sizes.max(initial=0.0)), 1e-9)
        return (u[:, kept] * sizes[kept]).reshape(len(self.circles), COEFFICIENTS, -1)

    def since(self, one: Seen) -> Finding | None:
        """Return the change since the session before; None without it."""
        if self.reference is None:
            return None
        label = self._planned[self.runs.index(one)]
        off = read_um(one) - expected_um(self.circles[label])
        session = self._of_session[label]
        covariance = self._own[label] + one.u_um**2 * np.eye(COEFFICIENTS) + 2.0 * session @ session.T
        value, limit = float(np.linalg.norm(off)), limit_along(covariance, off)
        since = f"{self.reference.measured.day} {self.reference.measured:%B}"
        verdict = FindingVerdict.GOOD if value <= limit else FindingVerdict.CANNOT_TELL
        word = "as" if value <= limit else "changed since"
        stated = f"{value:.1f} µm rms from session {self.reference.session}: {word} {since}"
        return Finding(Name.SINCE, value, limit, "µm", verdict, stated)

    @cached_property
    def _own(self) -> list[NDArray[np.float64]]:
        """Return the covariance of a circle's own part, ball and mounting, shape (7, 7) each [µm²]."""
        found = []
        for one in self.circles:
            effects = [e for key, e in one.expected.effects_um.items() if key[1] and key not in self._shared]
            signs = along_travel(one.circle)[:, None]
            joined = signs * np.hstack([np.zeros((COEFFICIENTS, 1)), *effects])
            own = (1.0 if self.reference is None else 2.0) * joined @ joined.T
            own += 1e-6 * np.eye(COEFFICIENTS)
            if not one.expected.place_known:
                own[[FIRST_COSINE, FIRST_SINE], [FIRST_COSINE, FIRST_SINE]] += ANYWHERE_UM**2
            found.append(own)
        return found


class _Beside:
    """Assignments that differ in few runs from a given one.

    The effects that all runs together leave possible serve all of them; runs are left out and put in by blocks
    [Rasmussen and Williams (2006), section 5.4.2].

    Attributes:
        log: log density of all readings under the given labels, machine errors of all sizes alike probable.
    """

    def __init__(self, sitting: Assigned, labels: Sequence[int]) -> None:
        self._sitting, self._labels = sitting, labels
        known, wide = sitting.information(labels), sitting.effects.shape[2]
        rows = sitting.effects.reshape(-1, wide)
        logs, covariances, means = [], [], []
        for size in SIZES:
            scale = sitting.scale(size)
            root = np.linalg.cholesky(np.eye(wide) + scale[:, None] * known[:-1, :-1] * scale)
            right = (np.vstack([known[-1:, :-1], rows]) * scale).T
            white = solve_triangular(root, right, lower=True, overwrite_b=True, check_finite=False)
            logs.append(0.5 * (white[:, 0] @ white[:, 0] - known[-1, -1]) - _log_diagonal(root))
            covariances.append(white[:, 1:].T @ white[:, 1:])
            means.append(white[:, 1:].T @ white[:, 0])
        count = len(sitting.effects)
        self._logs = np.array(logs)[:, None]
        self._covariance = np.reshape(covariances, (len(SIZES), count, COEFFICIENTS, count, COEFFICIENTS))
        self._mean = np.reshape(means, (len(SIZES), count, COEFFICIENTS))
        self.log = float(_mean_of(self._logs)[0])

    def changed(self, runs: Sequence[int], instead: Sequence[Sequence[int]]) -> NDArray[np.float64]:
        """Return the same with other labels of some runs, one by each of `instead`."""
        circles, off, scatter = self._of(runs, np.array([[self._labels[run] for run in runs]]))
        shared = self._between(circles, circles)
        root = np.linalg.cholesky(scatter - shared)
        pull = np.linalg.solve(root, (off - self._means(circles))[..., None])
        logs = self._logs + 0.5 * np.sum(pull**2, axis=(2, 3)) - _log_diagonal(root)
        logs += _log_diagonal(np.linalg.cholesky(scatter)) * 2.0
        others, off, scatter = self._of(runs, np.array(instead))
        turned = np.linalg.solve(root, self._between(circles, others))
        root = np.linalg.cholesky(scatter + self._between(others, others) + np.swapaxes(turned, -1, -2) @ turned)
        apart = (off - self._means(others))[..., None] + np.swapaxes(turned, -1, -2) @ pull
        white = np.linalg.solve(root, apart)
        return _mean_of(logs - 0.5 * np.sum(white**2, axis=(2, 3)) - _log_diagonal(root))

    def _of(
        self, runs: Sequence[int], labels: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Return circles, shape (m, k), readings minus expectation, (m, 7 k), and their own covariance, (m, 7 k, 7 k)."""
        circles = np.column_stack([self._sitting.shows(run, labels[:, k]) for k, run in enumerate(runs)])
        off = np.hstack([self._sitting.off[run][labels[:, k]] for k, run in enumerate(runs)])
        scatter = np.zeros((*off.shape, off.shape[1]))
        for k, run in enumerate(runs):
            rows = slice(COEFFICIENTS * k, COEFFICIENTS * (k + 1))
            scatter[:, rows, rows] = self._sitting.scatter[run][labels[:, k]]
        return circles, off, scatter

    def _between(self, one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return covariances of circles, shape (9, m, 7 k, 7 k) [µm²]."""
        found = self._covariance[:, one[:, :, None], :, other[:, None, :], :]
        wide = COEFFICIENTS * one.shape[1]
        return found.transpose(3, 0, 1, 4, 2, 5).reshape(len(SIZES), -1, wide, wide)

    def _means(self, circles: NDArray[np.int64]) -> NDArray[np.float64]:
        return self._mean[:, circles].reshape(len(SIZES), len(circles), -1)


_OTHERWISE = {
    ELSEWHERE: (Name.FORM, "it fits neither its place in the plan nor the other circles"),
    BESIDE: (Name.BORE, "its ball stands elsewhere"),
    LARGER: (Name.RADIUS, "its radius is another"),
}


def _put(labels: tuple[int, ...], changed: Mapping[int, int]) -> tuple[int, ...]:
    return tuple(changed.get(k, label) for k, label in enumerate(labels))


def _mean_of(logs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the log of the mean density over SIZES, shape (m,)."""
    return np.asarray(logsumexp(logs, axis=0) - np.log(len(SIZES)))


def _log_diagonal(roots: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return half the log determinants of matrices with these Cholesky factors."""
    return np.asarray(np.sum(np.log(np.diagonal(roots, axis1=-2, axis2=-1)), axis=-1))


def _key(one: Planned) -> tuple[str, str]:
    return one.test, str(one.circle.direction)
