"""Decide jointly which circle of the plan each run of a session shows.

A run filed under a wrong circle makes correct runs look wrong. Assignments of runs to circles are compared by marginal
likelihood over the machine's errors; each mistake has a prior probability. A sound session favours another assignment
by a factor f with a probability of at most 1 / f [Markov's inequality].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from heapq import nlargest
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import norm_of
from dbbstation.computing.grouped import grouped
from dbbstation.quality.beside import SIZES, NearAssignments, Readings, mean_of
from dbbstation.quality.finding import Finding, FindingVerdict, Name
from dbbstation.quality.limits import LOG_ODDS_LIMIT
from dbbstation.quality.plan_effects import BESIDE, ELSEWHERE, LARGER, PlanEffects, key_of
from dbbstation.quality.stated import limit_along
from dbbstation.quality.together import expected_um, read_um
from dbbstation.trace.expected import COEFFICIENTS, along_travel

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import date

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.quality.knowledge import Planned, Seen

MISTAKE = LOG_ODDS_LIMIT
"""Negative log prior probability of a mistake: an operator makes one in a thousand circles."""

WIDE = 3
"""Number of assignments that the search extends at once."""

AT_ONCE = 64
"""Number of assignments that are scored at once; it affects only the time."""


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
        """Return circles that expect the previous session's readings."""
        found = []
        for one in circles:
            more = along_travel(one.circle) * (self.read_um[key_of(one)] - expected_um(one))
            found.append(replace(one, expected=replace(one.expected, form_um=one.expected.form_um + more)))
        return tuple(found)


_Changes = tuple[tuple[int, int], ...]
"""Pairs of run and label, for labels other than the planned one, in ascending order."""

_Followed = tuple[_Changes, "Compared"]
"""An assignment with the expectation that makes it most probable."""


def effects_of(circles: Sequence[Planned], former: FormerSitting | None = None) -> tuple[PlanEffects, ...]:
    """Return effects on a plan's circles relative to their expectation, then to the previous session's readings."""
    moved = () if former is None else (PlanEffects(former.moved(circles), owns=2),)
    return (PlanEffects(circles), *moved)


class Compared:
    """A session's runs compared with a plan's circles under one expectation.

    Args:
        before: the same without the last run; None if unknown.

    Attributes:
        planned: labels of the circles under which the runs were filed.
        bounds: by assignment and changed runs, upper bounds of log densities with their other labels.
    """

    def __init__(self, effects: PlanEffects, runs: Sequence[Seen], before: Compared | None) -> None:
        self.effects = effects
        self._read = [effects.run(one) for one in runs]
        self.planned = [one.planned for one in self._read]
        self.bounds: dict[_Changes, dict[tuple[int, ...], Floats]] = {}
        self._before = {} if before is None else before.bounds

    def near(self, labels: Sequence[int]) -> NearAssignments:
        """Return log densities near an assignment."""
        return NearAssignments(self.effects, self._readings, self._information_of(labels), np.array(labels))

    def most(self, base: _Changes, runs: Integers, labels: int) -> Floats:
        """Return upper bounds of log densities near an assignment from before the last run; infinite if unknown.

        Args:
            runs: shape (m, k).
            labels: number of alternatives, j.
        """
        known, unknown = self._before.get(base, {}), np.full(labels, np.inf)
        # However well the last run is predicted, its reading scatters by its own part.
        most = -self._read[-1].half_log_determinants[self.planned[-1]]
        return most + np.array([known.get(tuple(each), unknown) for each in runs.tolist()])

    def _information_of(self, labels: Sequence[int]) -> Floats:
        """Return products of whitened effects and readings, summed over runs, shape (p + 1, p + 1)."""
        found = self._information.copy()
        for one, label, planned in zip(self._read, labels, self.planned, strict=True):
            if label != planned:
                found += one.product(label) - one.product(planned)
        return found

    @cached_property
    def _information(self) -> Floats:
        found = np.zeros_like(self._read[0].product(self.planned[0]))
        for one, planned in zip(self._read, self.planned, strict=True):
            found += one.product(planned)
        return found

    @cached_property
    def _readings(self) -> Readings:
        """Return the readings of all runs under every label."""
        return Readings.of(self._read)


class Assigned:
    """Joint decision on the circles that a session's runs show.

    Each assignment counts under the expectation that makes it most probable: errors of usual sizes, or changes since
    the previous session. A machine that was corrected since looks like neither its previous session nor a change.

    Args:
        effects: on the plan's circles, for each expectation with equal prior probability.
        runs: the last one is new; `finding` decides its circle.
        former: the previous session, to which the last of `effects` refers.
        before: the decision on earlier runs with the same effects; its bounds are used if only the last run is new.
    """

    def __init__(
        self,
        effects: Sequence[PlanEffects],
        runs: Sequence[Seen],
        former: FormerSitting | None = None,
        before: Assigned | None = None,
    ) -> None:
        self.former, self.effects, self.circles = former, effects, effects[0].circles
        self.runs = [one for one in runs if one.analysis is not None]
        earlier: Sequence[Compared | None] = [None] * len(effects)
        if before is not None and before.runs == self.runs[:-1]:
            earlier = before.compared
        self.compared: Sequence[Compared] = [
            Compared(each, self.runs, then) for each, then in zip(effects, earlier, strict=True)
        ]
        self.planned = self.compared[0].planned

    def odds(self, one: Seen) -> float:
        """Return the log odds against a run's planned circle."""
        return self._looked_up.odds(self.runs.index(one))

    def finding(self, one: Seen, undecided: Finding) -> Finding:
        """Return a good finding if all runs together show that a run is its planned circle, else `undecided`."""
        against = self.odds(one) + self.cost
        if against > self.cost - 2.0 * LOG_ODDS_LIMIT:
            return undecided
        limit, text = self.cost, f"all {len(self.runs)} circles together show it"
        return Finding(undecided.name, max(against, 0.0), limit, "", FindingVerdict.GOOD, text)

    def suspects(self) -> dict[Seen, Finding]:
        """Return the runs that contradict the others, with findings that name the circles shown instead."""
        likely = [dict(changes) for changes in self._looked_up.likely()]
        found = {}
        for at, one in enumerate(self.runs):
            changed = [labels[at] for labels in likely if at in labels]
            if changed:
                # If a misplaced ball is equally likely, report it first.
                label = min(changed, key=lambda one: one not in {BESIDE, LARGER})
                found[one] = self._wrong(one, label, certain=len(changed) == len(likely))
        return found

    def _wrong(self, one: Seen, label: int, *, certain: bool) -> Finding:
        value, limit = max(self.odds(one), 0.0) + self.cost, self.cost
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

    @cached_property
    def cost(self) -> float:
        """Return the cost of one mistake."""
        return MISTAKE + float(np.log(len(self.circles)))

    @cached_property
    def _looked_up(self) -> Known:
        known = Known(len(self.runs))
        followed: set[_Followed] = set()
        best: list[_Followed] = [((), each) for each in self.compared]
        while best:
            near = [(changes, each, each.near(self._labels(changes))) for changes, each in best]
            for changes, each, beside in near:
                known.add(changes, beside.log - self._mistakes(changes), each)
            for one in near:
                self._follow(*one, known)
            followed |= set(best)
            # Of k mistakes that repay k - 1 of their costs, one repays half of its own or more.
            least = known.planned - 0.5 * self.cost
            best = [(changes, by) for changes, (log, by) in known.best() if log >= least]
            best = [each for each in best if each not in followed]
        return known

    def _follow(self, base: _Changes, compared: Compared, beside: NearAssignments, known: Known) -> None:
        """Add assignments near a given one, the most probable first, until further ones cannot affect a decision."""
        least = known.planned - max(self.cost, 2.0 * LOG_ODDS_LIMIT)
        asked = [_Asked(self, compared, base, beside, *each, least) for each in self._changes]
        compared.bounds[base] = {tuple(run): row for each in asked for run, row in each.bounds}
        while True:
            limits = _Limits.of(known, self.cost, len(self.runs) - 1)
            wanted = [each.wanted(limits) for each in asked]
            ranked = np.sort(np.concatenate(wanted, axis=None))[-AT_ONCE:]
            if ranked[-1] == -np.inf:
                return
            first = ranked[ranked > -np.inf][0]
            for each, most in zip(asked, wanted, strict=True):
                places = np.nonzero(most >= first)
                for runs, instead, log in each.scored(places) if len(places[0]) else ():
                    changes = self._with(base, runs, instead)
                    known.add(changes, log - self._mistakes(changes), compared)

    def _labels(self, changes: _Changes) -> list[int]:
        labels = dict(changes)
        return [labels.get(run, planned) for run, planned in enumerate(self.planned)]

    def _with(self, base: _Changes, runs: Sequence[int], other: Sequence[int]) -> _Changes:
        changed = {**dict(base), **dict(zip(runs, other, strict=True))}
        return tuple(sorted(each for each in changed.items() if each[1] != self.planned[each[0]]))

    @cached_property
    def _changes(self) -> tuple[tuple[Integers, Integers], ...]:
        """Return runs, shape (m, k), and their other labels, (m, j, k), grouped by k and j."""
        alike = grouped(((len(runs), len(instead)), (runs, instead)) for runs, instead in self._all_changes())
        return tuple(
            (np.array([runs for runs, _ in each]), np.array([labels for _, labels in each])) for each in alike.values()
        )

    def _all_changes(self) -> Iterator[tuple[Sequence[int], Sequence[Sequence[int]]]]:
        yield from (([run], [[label] for label in self._everything]) for run in range(len(self.runs)))
        tests = dict.fromkeys(one.test for one in self.circles)
        shown = [({test: self._as_test(group, test) for test in tests}, group) for group in self._groups]
        for by_test, group in shown:
            if len(group) > 1:
                yield group, [each for each in by_test.values() if each]
        for (first, one), (second, other) in combinations(shown, 2):
            exchanged = first[self.runs[other[0]].run.test], second[self.runs[one[0]].run.test]
            if all(exchanged):
                yield [*one, *other], [[*exchanged[0], *exchanged[1]]]

    @cached_property
    def _everything(self) -> tuple[int, ...]:
        return (*range(len(self.circles)), LARGER, BESIDE, ELSEWHERE)

    @cached_property
    def _groups(self) -> list[list[int]]:
        return list(grouped(((one.run.test, one.run.mounting), k) for k, one in enumerate(self.runs)).values())

    def _as_test(self, group: Sequence[int], test: str) -> list[int]:
        """Return labels for a group's runs, taken as runs of a test; empty if the plan lacks such a circle."""
        labels = [self.effects[0].labels.get((test, self.runs[k].run.circle.direction)) for k in group]
        known = [label for label in labels if label is not None]
        return known if len(known) == len(labels) else []

    def fewest_mistakes(self, base: _Changes, runs: Integers, instead: Integers) -> Floats:
        """Return lower bounds of the cost of mistakes near a given assignment; arguments as of `NearAssignments.most`."""
        tests = {test: k for k, test in enumerate(dict.fromkeys(one.test for one in self.circles))}
        of_label = np.array([*(tests[one.test] for one in self.circles), *[len(tests)] * 3])
        of_run = np.array([tests[one.run.test] for one in self.runs])
        involved = np.zeros(len(tests) + 1, dtype=bool)
        involved[[*(of_run[run] for run, _ in base), *(of_label[label] for _, label in base)]] = True
        involved[-1] = False
        shared = involved[of_run[runs]].any(axis=1)[:, None] | involved[of_label[instead]].any(axis=2)
        # Changes of the same tests may count as one mistake.
        return np.where(shared, self.cost, self._mistakes(base) + self.cost)

    def _mistakes(self, changes: _Changes) -> float:
        """Return the cost of mistakes; a mounting filed under another test, or an exchange of two mountings, counts as one."""
        whole: set[frozenset[str]] = set()
        single = 0
        by_group = grouped((self._group_of[run], self._shown(run, label)) for run, label in changes)
        for group, shown in by_group.items():
            runs = self._groups[group]
            if shown[0] and shown.count(shown[0]) == len(runs):
                whole.add(frozenset({self.runs[runs[0]].run.test, shown[0]}))
            else:
                single += len(shown)
        return self.cost * (len(whole) + single)

    @cached_property
    def _group_of(self) -> Mapping[int, int]:
        return {run: at for at, group in enumerate(self._groups) for run in group}

    def _shown(self, run: int, label: int) -> str:
        """Return the test of a circle that a run shows in the run's own direction; else nothing."""
        same_way = label >= 0 and self.circles[label].circle.direction is self.runs[run].run.circle.direction
        return self.circles[label].test if same_way else ""

    def since(self, one: Seen) -> Finding | None:
        """Return the finding on changes since the previous session; None without such a session."""
        if self.former is None:
            return None
        effects, label = self.effects[-1], self.planned[self.runs.index(one)]
        off = read_um(one) - expected_um(effects.circles[label])
        session = effects.of_session[label]
        covariance = effects.own[label] + one.u_um**2 * np.eye(COEFFICIENTS) + 2.0 * session @ session.T
        value, limit = norm_of(off), limit_along(covariance, off)
        since = f"{self.former.measured.day} {self.former.measured:%B}"
        verdict = FindingVerdict.GOOD if value <= limit else FindingVerdict.CANNOT_TELL
        word = "as" if value <= limit else "changed since"
        stated = f"{value:.1f} µm rms from session {self.former.session}: {word} {since}"
        return Finding(Name.SINCE, value, limit, "µm", verdict, stated)


class _Asked:
    """Assignments near a given one, with upper bounds of their log posterior densities.

    Args:
        least: log posterior density below which none can affect a decision.
    """

    def __init__(
        self,
        sitting: Assigned,
        compared: Compared,
        base: _Changes,
        beside: NearAssignments,
        runs: Integers,
        instead: Integers,
        least: float,
    ) -> None:
        self._beside, self._base, self._planned = beside, dict(base), sitting.planned
        self._runs, self._instead = runs, instead
        self._fewest = sitting.fewest_mistakes(base, runs, instead)
        self._bounds = compared.most(base, runs, instead.shape[1])
        asked = np.flatnonzero((self._bounds - self._fewest >= least).any(axis=1))
        self._logs = np.full((len(SIZES), *self._bounds.shape), -np.inf)
        self._logs[:, asked] = beside.most(runs[asked], instead[asked], least + sitting.cost)
        self._bounds[asked] = np.minimum(self._bounds[asked], mean_of(self._logs[:, asked]))
        given = (instead == beside.labels[runs][:, None, :]).all(axis=2)
        self._most = np.where(given, -np.inf, self._bounds - self._fewest)

    @property
    def bounds(self) -> Iterator[tuple[list[int], Floats]]:
        """Return runs, and upper bounds of the log densities with their other labels, shape (j,)."""
        return zip(self._runs.tolist(), self._bounds, strict=True)

    def wanted(self, limits: _Limits) -> Floats:
        """Return upper bounds of assignments that can affect a decision, shape (m, j); minus infinity elsewhere."""
        limit = np.full(self._most.shape, limits.any_run)
        for run, own in limits.suspects.items():
            limit = np.where(self._changed(run), limit, np.minimum(limit, own))
        new = len(self._planned) - 1
        self._limit = np.where(self._changed(new), np.minimum(limit, limits.new), limit)
        return np.where(self._most >= self._limit, self._most, -np.inf)

    def scored(self, places: tuple[Integers, ...]) -> Iterator[tuple[list[int], list[int], float]]:
        """Yield runs, labels and log densities of assignments that reach their limit, each once."""
        runs, instead = self._runs[places[0]], self._instead[places]
        self._most[places] = -np.inf
        limit = self._limit[places] + self._fewest[places]
        logs = self._beside.changed(runs, instead, self._logs[:, places[0], places[1]], limit)
        self._bounds[places] = logs
        for k in np.flatnonzero(logs >= limit):
            yield runs[k].tolist(), instead[k].tolist(), float(logs[k])

    def _changed(self, run: int) -> Flags:
        """Return whether assignments change a run's planned circle, shape (m, j)."""
        here = (self._runs == run)[:, None, :]
        other = (here & (self._instead != self._planned[run])).any(axis=2)
        return np.where(here.any(axis=2), other, run in self._base)


@dataclass(frozen=True)
class _Limits:
    """Log posterior densities below which an assignment cannot affect a decision.

    Attributes:
        any_run: below it, an assignment is not extended and makes no run suspect.
        suspects: by suspect run, for assignments that keep the run's planned circle, which the odds compare.
        new: for assignments that change the new run's planned circle.
    """

    any_run: float
    suspects: Mapping[int, float]
    new: float

    @classmethod
    def of(cls, known: Known, cost: float, new: int) -> _Limits:
        """Return the limits that follow from known log posterior densities."""
        best, floor = known.best(), known.planned
        followed = _log(best[-1]) if len(best) == WIDE else -np.inf
        suspects = {run for changes in known.likely() for run, _ in changes}
        return cls(
            max(floor - cost, min(followed, max(floor, _log(best[0]) - LOG_ODDS_LIMIT))),
            {run: known.kept[run] for run in suspects},
            max(known.changed[new], known.kept[new] - 2.0 * LOG_ODDS_LIMIT),
        )


class Known:
    """Known assignments with their log posterior densities.

    Attributes:
        kept: greatest density of an assignment that keeps a run's planned circle, shape (n,).
        changed: of one that changes it, shape (n,).
    """

    def __init__(self, runs: int) -> None:
        self._logs: dict[_Changes, tuple[float, Compared]] = {}
        self.kept, self.changed = np.full(runs, -np.inf), np.full(runs, -np.inf)

    @property
    def planned(self) -> float:
        """Return the log posterior density of the plan."""
        return self._logs[()][0]

    def add(self, changes: _Changes, log: float, by: Compared) -> None:
        """Add an assignment under an expectation if none makes it more probable."""
        if changes in self._logs and log <= self._logs[changes][0]:
            return
        self._logs[changes] = log, by
        runs = [run for run, _ in changes]
        changed = np.maximum(self.changed[runs], log)
        kept = self.kept[runs]
        np.maximum(self.kept, log, out=self.kept)
        self.kept[runs], self.changed[runs] = kept, changed

    def odds(self, run: int) -> float:
        """Return the log odds against a run's planned circle."""
        return float(self.changed[run] - self.kept[run])

    def best(self) -> list[tuple[_Changes, tuple[float, Compared]]]:
        """Return the most probable assignments, in descending order."""
        return nlargest(WIDE, self._logs.items(), key=_log)

    def likely(self) -> list[_Changes]:
        """Return assignments more probable than the plan, and nearly as probable as the best, in descending order."""
        floor, least = self.planned, _log(self.best()[0]) - LOG_ODDS_LIMIT
        found = [each for each in self._logs.items() if _log(each) > floor and _log(each) >= least]
        return [changes for changes, _ in sorted(found, key=_log, reverse=True)]


def _log(one: tuple[_Changes, tuple[float, Compared]]) -> float:
    return one[1][0]


_OTHERWISE = {
    ELSEWHERE: (Name.FORM, "it fits neither its place in the plan nor the other circles"),
    BESIDE: (Name.BORE, "its ball stands elsewhere"),
    LARGER: (Name.RADIUS, "its radius is another"),
}
