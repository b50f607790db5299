"""Decide jointly which circle of the plan each run of a session shows.

A run filed under a wrong circle makes correct runs look wrong. Assignments of runs to circles are compared by marginal
likelihood over the machine's errors; each mistake has a prior probability. A sound session favours another assignment
by a factor f with a probability of at most 1 / f [Markov's inequality].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from dbbstation.quality.finding import Finding, FindingVerdict, Name
from dbbstation.quality.forms import SIZES as SHARES
from dbbstation.quality.knowledge import COEFFICIENTS, along_travel
from dbbstation.quality.limits import LOG_ODDS_LIMIT
from dbbstation.quality.plan_effects import BESIDE, ELSEWHERE, LARGER, PlanEffects, key_of, log_diagonal
from dbbstation.quality.stated import limit_along
from dbbstation.quality.together import expected_um, read_um

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import date

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.quality.knowledge import Planned, Seen

MISTAKE = LOG_ODDS_LIMIT
"""Negative log prior probability of a mistake: an operator makes one in a thousand circles."""

SIZES = np.append(0.0, SHARES)
"""Machine errors relative to their usual size. A simulated machine may have zero errors; every circle then fits any run equally well."""

WIDE = 3
"""Number of assignments that the search extends at once."""


@dataclass(frozen=True, eq=False)
class FormerSitting:
    """The previous session of the same machine and plan.

    Attributes:
        read_um: readings along the travel by test and direction, shape (7,) each [µm].
    """

    session: str
    measured: date
    read_um: Mapping[tuple[str, str], Floats]

    def moved(self, circles: Sequence[Planned]) -> tuple[Planned, ...]:
        """Return circles with this session's readings as expectation."""
        found = []
        for one in circles:
            more = along_travel(one.circle) * (self.read_um[key_of(one)] - expected_um(one))
            found.append(replace(one, expected=replace(one.expected, form_um=one.expected.form_um + more)))
        return tuple(found)


_Changes = tuple[tuple[int, int], ...]
"""Pairs of run and label, for labels other than the planned one, in ascending order."""


def effects_of(circles: Sequence[Planned], reference: FormerSitting | None = None) -> PlanEffects:
    """Return effects on a plan's circles, relative to the previous session's readings."""
    moved = circles if reference is None else reference.moved(circles)
    return PlanEffects(moved, owns=1 if reference is None else 2)


class Assigned:
    """Joint decision on the circles that a session's runs show.

    Args:
        effects: on the plan's circles, relative to the same reference.
        before: result for the first runs of the same plan; assignments that were very improbable are not computed again.
    """

    def __init__(
        self,
        effects: PlanEffects,
        runs: Sequence[Seen],
        reference: FormerSitting | None = None,
        before: Assigned | None = None,
    ) -> None:
        self.reference, self.effects, self.circles = reference, effects, effects.circles
        self.runs = [one for one in runs if one.analysis is not None]
        self.read = [self.effects.run(one) for one in self.runs]
        self._planned = [one.planned for one in self.read]
        # Log densities, or their upper bounds, by differences from the plan.
        self.most: dict[_Changes, float] = {}
        past = before if before is not None and before.runs == self.runs[: len(before.runs)] else None
        self._known_before = {} if past is None else past.most
        self._fresh = range(0 if past is None else len(past.runs), len(self.runs))

    def odds(self, one: Seen) -> float:
        """Return the log odds against a run's planned circle."""
        at, known = self.runs.index(one), self._looked_up
        own = max(score for changes, score in known.items() if at not in dict(changes))
        others = (score for changes, score in known.items() if at in dict(changes))
        return max(others, default=-np.inf) - own

    def finding(self, one: Seen, undecided: Finding) -> Finding:
        """Return the finding that a run shows its planned circle, or `undecided` if all runs together cannot decide."""
        against = self.odds(one) + self._cost
        if against > self._cost - 2.0 * LOG_ODDS_LIMIT:
            return undecided
        limit, text = self._cost, f"all {len(self.runs)} circles together show it"
        return Finding(undecided.name, max(against, 0.0), limit, "", FindingVerdict.GOOD, text)

    def suspects(self) -> dict[Seen, Finding]:
        """Return the runs that contradict the others, with findings that name the circles shown instead."""
        known = self._looked_up
        floor, top = known[()], max(known.values())
        scored = [one for one in known.items() if one[1] > floor and one[1] >= top - LOG_ODDS_LIMIT]
        likely = [dict(changes) for changes, _ in sorted(scored, key=lambda one: one[1], reverse=True)]
        found = {}
        for at, one in enumerate(self.runs):
            changed = [labels[at] for labels in likely if at in labels]
            if changed:
                # If a misplaced ball is equally likely, report it first.
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
    def _looked_up(self) -> Mapping[_Changes, float]:
        known: dict[_Changes, float] = {(): self.score(())}
        least = known[()] - self._cost
        followed: set[_Changes] = set()
        best: list[_Changes] = [()]
        while any(changes not in followed for changes in best):
            for changes in [each for each in best if each not in followed]:
                followed.add(changes)
                known.update(self._follow(changes, least))
            best = sorted(known, key=known.__getitem__, reverse=True)[:WIDE]
            # If one mistake alone loses more than its cost, a further one cannot repay it.
            best = [changes for changes in best if known[changes] >= least]
        return known

    def _follow(self, base: _Changes, least: float) -> dict[_Changes, float]:
        beside = _Beside(self, self._labels(base))
        found: dict[_Changes, float] = {}
        for runs, instead in self._changes:
            asked = {}
            for other in instead:
                changes = self._with(base, runs, other)
                if changes not in self.most:
                    self.most[changes] = self._at_most(changes)
                    if self._is_asked(changes, least):
                        asked[changes] = other
            if asked:
                for changes, log in zip(asked, beside.changed(runs, list(asked.values())), strict=True):
                    self.most[changes] = float(log)
                    found[changes] = self.score(changes)
        return found

    def _is_asked(self, changes: _Changes, least: float) -> bool:
        """Return whether an assignment can affect a decision: by extension, or by doubt about a new run."""
        if any(run in self._fresh for run, _ in changes):
            least -= 2.0 * LOG_ODDS_LIMIT - self._cost
        spare = self.most[changes] - least
        return spare >= self._cost and spare >= self._mistakes(changes)

    def _at_most(self, changes: _Changes) -> float:
        """Return an upper bound of a log density, from its value before the last runs."""
        # However well a run is predicted, its readings scatter by their own part.
        count = self._fresh.start
        most = self._known_before.get(tuple(each for each in changes if each[0] < count), np.inf)
        labels = dict(changes)
        for run in self._fresh:
            most -= float(self.read[run].half_log_determinants[labels.get(run, self._planned[run])])
        return most

    def _labels(self, changes: _Changes) -> list[int]:
        labels = dict(changes)
        return [labels.get(run, planned) for run, planned in enumerate(self._planned)]

    def _with(self, base: _Changes, runs: Sequence[int], other: Sequence[int]) -> _Changes:
        changed = {**dict(base), **dict(zip(runs, other, strict=True))}
        return tuple(sorted(each for each in changed.items() if each[1] != self._planned[each[0]]))

    @cached_property
    def _changes(self) -> tuple[tuple[Sequence[int], Sequence[Sequence[int]]], ...]:
        return tuple(self._all_changes())

    def _all_changes(self) -> Iterator[tuple[Sequence[int], Sequence[Sequence[int]]]]:
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
            return [self.effects.label(test, self.runs[k].run.circle.direction) for k in group]
        except StopIteration:
            return None

    def score(self, changes: _Changes) -> float:
        """Return the log posterior density of an assignment: likelihood less cost of mistakes."""
        if changes not in self.most:
            self.most[changes] = _Beside(self, self._labels(changes)).log
        return self.most[changes] - self._mistakes(changes)

    def _mistakes(self, changes: _Changes) -> float:
        """Return the cost of mistakes; a mounting filed under another test, or an exchange of two mountings, counts as one."""
        whole: set[frozenset[str]] = set()
        single, labels = 0, dict(changes)
        for group in {id(group): group for group in (self._group_of[run] for run in labels)}.values():
            changed = [k for k in group if k in labels]
            shown = {self.circles[labels[k]].test if self._same_way(k, labels[k]) else "" for k in changed}
            if len(changed) == len(group) and len(shown) == 1 and "" not in shown:
                whole.add(frozenset({self.runs[group[0]].run.test, *shown}))
            else:
                single += len(changed)
        return self._cost * (len(whole) + single)

    @cached_property
    def _group_of(self) -> Mapping[int, list[int]]:
        return {run: group for group in self._groups for run in group}

    def _same_way(self, run: int, label: int) -> bool:
        return label >= 0 and self.circles[label].circle.direction is self.runs[run].run.circle.direction

    def information(self, labels: Sequence[int]) -> Floats:
        """Return products of whitened effects and readings, summed over runs, shape (p + 1, p + 1)."""
        return np.sum([one.product(label) for one, label in zip(self.read, labels, strict=True)], axis=0)

    def since(self, one: Seen) -> Finding | None:
        """Return the finding on changes since the previous session; None without one."""
        if self.reference is None:
            return None
        label = self._planned[self.runs.index(one)]
        off = read_um(one) - expected_um(self.circles[label])
        session = self.effects.of_session[label]
        covariance = self.effects.own[label] + one.u_um**2 * np.eye(COEFFICIENTS) + 2.0 * session @ session.T
        value, limit = float(np.linalg.norm(off)), limit_along(covariance, off)
        since = f"{self.reference.measured.day} {self.reference.measured:%B}"
        verdict = FindingVerdict.GOOD if value <= limit else FindingVerdict.CANNOT_TELL
        word = "as" if value <= limit else "changed since"
        stated = f"{value:.1f} µm rms from session {self.reference.session}: {word} {since}"
        return Finding(Name.SINCE, value, limit, "µm", verdict, stated)


class _Beside:
    """Log densities of assignments that differ in few runs from a given one.

    The posterior of the shared effects, given all runs, is computed once. Runs are removed and inserted by blocks
    [Rasmussen and Williams (2006), section 5.4.2].

    Attributes:
        log: log density of all readings under the given labels, with equal prior probability for all sizes of machine errors.
    """

    def __init__(self, sitting: Assigned, labels: Sequence[int]) -> None:
        self._read, self._labels = sitting.read, labels
        known, shared = sitting.information(labels), sitting.effects.shared
        wide = shared.shape[2]
        rows = shared.reshape(-1, wide)
        logs, covariances, means = [], [], []
        for size in SIZES:
            scale = sitting.effects.scale(size)
            root = np.linalg.cholesky(np.eye(wide) + scale[:, None] * known[:-1, :-1] * scale)
            right = (np.vstack([known[-1:, :-1], rows]) * scale).T
            white = solve_triangular(root, right, lower=True, overwrite_b=True, check_finite=False)
            logs.append(0.5 * (white[:, 0] @ white[:, 0] - known[-1, -1]) - log_diagonal(root))
            covariances.append(white[:, 1:].T @ white[:, 1:])
            means.append(white[:, 1:].T @ white[:, 0])
        count = len(shared)
        self._logs = np.array(logs)[:, None]
        self._covariance = np.reshape(covariances, (len(SIZES), count, COEFFICIENTS, count, COEFFICIENTS))
        self._mean = np.reshape(means, (len(SIZES), count, COEFFICIENTS))
        self.log = float(_mean_of(self._logs)[0])

    def changed(self, runs: Sequence[int], instead: Sequence[Sequence[int]]) -> Floats:
        """Return the log densities with other labels of some runs, one for each item of `instead`."""
        circles, off, scatter = self._of(runs, np.array([[self._labels[run] for run in runs]]))
        shared = self._between(circles, circles)
        root = np.linalg.cholesky(scatter - shared)
        pull = np.linalg.solve(root, (off - self._means(circles))[..., None])
        logs = self._logs + 0.5 * np.sum(pull**2, axis=(2, 3)) - log_diagonal(root)
        logs += log_diagonal(np.linalg.cholesky(scatter)) * 2.0
        others, off, scatter = self._of(runs, np.array(instead))
        turned = np.linalg.solve(root, self._between(circles, others))
        root = np.linalg.cholesky(scatter + self._between(others, others) + np.swapaxes(turned, -1, -2) @ turned)
        apart = (off - self._means(others))[..., None] + np.swapaxes(turned, -1, -2) @ pull
        white = np.linalg.solve(root, apart)
        return _mean_of(logs - 0.5 * np.sum(white**2, axis=(2, 3)) - log_diagonal(root))

    def _of(self, runs: Sequence[int], labels: Integers) -> tuple[Integers, Floats, Floats]:
        """Return circles, shape (m, k), readings minus expectation, (m, 7 k), and their own covariance, (m, 7 k, 7 k)."""
        circles = np.column_stack([self._read[run].shows(labels[:, k]) for k, run in enumerate(runs)])
        off = np.hstack([self._read[run].off[labels[:, k]] for k, run in enumerate(runs)])
        scatter = np.zeros((*off.shape, off.shape[1]))
        for k, run in enumerate(runs):
            rows = slice(COEFFICIENTS * k, COEFFICIENTS * (k + 1))
            scatter[:, rows, rows] = self._read[run].scatter[labels[:, k]]
        return circles, off, scatter

    def _between(self, one: Integers, other: Integers) -> Floats:
        """Return covariances of circles, shape (9, m, 7 k, 7 k) [µm²]."""
        found = self._covariance[:, one[:, :, None], :, other[:, None, :], :]
        wide = COEFFICIENTS * one.shape[1]
        return found.transpose(3, 0, 1, 4, 2, 5).reshape(len(SIZES), -1, wide, wide)

    def _means(self, circles: Integers) -> Floats:
        return self._mean[:, circles].reshape(len(SIZES), len(circles), -1)


_OTHERWISE = {
    ELSEWHERE: (Name.FORM, "it fits neither its place in the plan nor the other circles"),
    BESIDE: (Name.BORE, "its ball stands elsewhere"),
    LARGER: (Name.RADIUS, "its radius is another"),
}


def _mean_of(logs: Floats) -> Floats:
    """Return the log of the mean density over SIZES, shape (m,)."""
    return np.asarray(np.logaddexp.reduce(logs, axis=0) - np.log(len(SIZES)))
