"""Which circle of the plan each run shows: all runs of a sitting together.

A run that was taken for another circle makes right runs look wrong. Assignments of runs to circles are compared by their
marginal likelihood over the machine's errors, each mistake at its prior probability. A sound sitting favours another
assignment by f with a chance of at most 1 / f [Markov's inequality].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import logsumexp

from dbbstation.quality.finding import Finding, FindingVerdict, Name
from dbbstation.quality.forms import FIRST_COSINE, FIRST_SINE, SIZES
from dbbstation.quality.knowledge import COEFFICIENTS, along_travel
from dbbstation.quality.limits import FALSE_ALARMS_PER_RUN
from dbbstation.quality.stated import limit_along
from dbbstation.quality.together import expected_um, read_um

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import date

    from numpy.typing import NDArray

    from dbbstation.quality.knowledge import Planned, Seen

LIMIT = -float(np.log(FALSE_ALARMS_PER_RUN))
"""Logarithm of the odds that decide: one sound run in a thousand is taken for another circle."""

MISTAKE = LIMIT
"""What a mistake costs, as a logarithm: an operator makes one in a thousand circles."""

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
        """Return circles that are expected as this session read them."""
        found = []
        for one in circles:
            more = along_travel(one.circle) * (self.read_um[_key(one)] - expected_um(one))
            found.append(replace(one, expected=replace(one.expected, form_um=one.expected.form_um + more)))
        return tuple(found)


class Assigned:
    """Runs of a sitting and the circles that they may show.

    Args:
        circles: of the plan, as the nominal machine or a model expects them.
        runs: that count, and the present one.
        reference: None: no session before.
    """

    def __init__(
        self, circles: Sequence[Planned], runs: Sequence[Seen], reference: FormerSitting | None = None
    ) -> None:
        self.reference = reference
        self.circles = circles if reference is None else reference.moved(circles)
        self.runs = [one for one in runs if one.analysis is not None]
        self._planned = [self._label(one.run.test, one.run.circle.direction) for one in self.runs]
        self._known: dict[tuple[int, ...], float] = {}
        self._logs: dict[tuple[int, int], float] = {}
        self._added: dict[tuple[int, int], tuple[NDArray[np.float64], NDArray[np.float64], float]] = {}

    def _label(self, test: str, direction: str) -> int:
        return next(k for k, one in enumerate(self.circles) if _key(one) == (test, direction))

    def odds(self, one: Seen) -> float:
        """Return the logarithm of the odds against a run's own circle."""
        at, known = self.runs.index(one), self._looked_up
        own = max(score for labels, score in known.items() if labels[at] == self._planned[at])
        others = (score for labels, score in known.items() if labels[at] != self._planned[at])
        return max(others, default=-np.inf) - own

    def finding(self, one: Seen, undecided: Finding) -> Finding:
        """Return a finding on which circle a run shows, decided where all runs together decide it."""
        against = self.odds(one) + self._cost
        if against > self._cost - 2.0 * LIMIT:
            return undecided
        limit, text = self._cost, f"all {len(self.runs)} circles together show it"
        return Finding(undecided.name, max(against, 0.0), limit, "", FindingVerdict.GOOD, text)

    def suspects(self) -> dict[Seen, Finding]:
        """Return the runs that contradict the others, each with what it shows instead."""
        known = self._looked_up
        floor = known[tuple(self._planned)]
        top = max(known.values())
        likely = [labels for labels, score in known.items() if score > floor and score >= top - LIMIT]
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
        """What one mistake costs."""
        return MISTAKE + float(np.log(len(self.circles)))

    @cached_property
    def _looked_up(self) -> Mapping[tuple[int, ...], float]:
        """Return assignments with their scores: mistake by mistake about the likeliest so far."""
        followed: set[tuple[int, ...]] = set()
        best = [tuple(self._planned)]
        least = self.score(best[0]) - self._cost
        while any(labels not in followed for labels in best):
            for labels in [each for each in best if each not in followed]:
                followed.add(labels)
                for neighbour in self._neighbours(labels):
                    self.score(neighbour)
            best = sorted(self._known, key=self._known.__getitem__, reverse=True)[:WIDE]
            # One mistake more cannot bring more than it costs where one alone lost as much.
            best = [labels for labels in best if self._known[labels] >= least]
        return self._known

    def _neighbours(self, labels: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        """Yield assignments that differ by one run, by all runs of a mounting, or by two mountings that change places."""
        open_to = [at for at in range(len(labels)) if not self._settled(labels, [at])]
        for at in open_to:
            yield from (_put(labels, {at: other}) for other in self._everything if other != labels[at])
        groups = self._groups
        for group in (one for one in groups if not self._settled(labels, one)):
            for test in dict.fromkeys(one.test for one in self.circles):
                changed = self._as_test(group, test)
                if changed is not None:
                    yield _put(labels, changed)
        for k, one in enumerate(groups):
            for other in groups[k + 1 :]:
                first = self._as_test(one, self.runs[other[0]].run.test)
                second = self._as_test(other, self.runs[one[0]].run.test)
                if first is not None and second is not None:
                    yield _put(labels, {**first, **second})

    def _settled(self, labels: tuple[int, ...], runs: Sequence[int]) -> bool:
        """Return whether no other circles of these runs can come near the planned assignment, wherever they were read.

        No density of a reading is above that at its expectation, known machine errors taken for sure.
        """
        others = [k for k in range(len(labels)) if k not in runs]
        most = sum(max(-0.5 * self._log_variance(k, label) for label in self._everything) for k in runs)
        cost = self._cost if labels == tuple(self._planned) else 0.0
        reached = self._likelihood(labels, others) + most - self._mistakes(labels) - cost
        return reached <= self._known[tuple(self._planned)] - 2.0 * LIMIT

    @cached_property
    def _everything(self) -> tuple[int, ...]:
        return (*range(len(self.circles)), ELSEWHERE, BESIDE, LARGER)

    @cached_property
    def _groups(self) -> list[list[int]]:
        found: dict[tuple[str, str], list[int]] = {}
        for k, one in enumerate(self.runs):
            found.setdefault((one.run.test, one.run.mounting), []).append(k)
        return list(found.values())

    def _as_test(self, group: Sequence[int], test: str) -> dict[int, int] | None:
        try:
            return {k: self._label(test, self.runs[k].run.circle.direction) for k in group}
        except StopIteration:
            return None

    def score(self, labels: tuple[int, ...]) -> float:
        """Return the log likelihood of an assignment with its mistakes."""
        if labels not in self._known:
            self._known[labels] = self._likelihood(labels) - self._mistakes(labels)
        return self._known[labels]

    def _mistakes(self, labels: Sequence[int]) -> float:
        """Return what mistakes cost: all runs of a mounting under another test are one, so are two that changed places."""
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

    def _likelihood(self, labels: Sequence[int], runs: Sequence[int] | None = None) -> float:
        """Return the log density of readings, machine errors of all sizes alike probable.

        Args:
            runs: whose readings; None: of all.
        """
        of_machine = self._of_machine.shape[2]
        wide = of_machine + self._of_session.shape[2]
        square, pull, apart = np.zeros((wide, wide)), np.zeros(wide), 0.0
        for run in range(len(labels)) if runs is None else runs:
            gram, along, own = self._part(run, labels[run])
            square, pull, apart = square + gram, pull + along, apart + own
        scale = np.ones((len(SIZES), wide))
        scale[:, :of_machine] = SIZES[:, None]
        precision = np.eye(wide) + scale[:, :, None] * square * scale[:, None, :]
        logs = np.zeros(len(SIZES))
        for k, (each, pulls) in enumerate(zip(precision, scale * pull, strict=True)):
            root, lower = cho_factor(each, lower=True, overwrite_a=True, check_finite=False)
            logs[k] = 0.5 * float(pulls @ cho_solve((root, lower), pulls, check_finite=False))
            logs[k] -= float(np.sum(np.log(np.diagonal(root))))
        return float(logsumexp(logs)) - float(np.log(len(SIZES))) - 0.5 * apart

    def _part(self, run: int, label: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return what a run adds to the squares, to the pulls, and its own distance."""
        if (run, label) in self._added:
            return self._added[run, label]
        one = self.runs[run]
        if label == ELSEWHERE:
            off = read_um(one) - expected_um(self.circles[self._planned[run]])
            wide = self._of_machine.shape[2] + self._of_session.shape[2]
            apart = float(off @ off) / ELSEWHERE_UM**2 + self._log_variance(run, label)
            found = np.zeros((wide, wide)), np.zeros(wide), apart
        else:
            shown = self._planned[run] if label < 0 else label
            columns = np.hstack([self._of_machine[shown], self._of_session[shown]])
            off = read_um(one) - expected_um(self.circles[shown])
            root = self._root(run, label)
            white, apart_by = np.linalg.solve(root, columns), np.linalg.solve(root, off)
            apart = float(apart_by @ apart_by) + self._log_variance(run, label)
            found = white.T @ white, white.T @ apart_by, apart
        self._added[run, label] = found
        return found

    def _root(self, run: int, label: int) -> NDArray[np.float64]:
        """Return the Cholesky factor of what a reading scatters by beside all others, shape (7, 7) [µm]."""
        own = self._own[self._planned[run] if label < 0 else label] + self.runs[run].u_um ** 2 * np.eye(COEFFICIENTS)
        for k in {BESIDE: (FIRST_COSINE, FIRST_SINE), LARGER: (0,)}.get(label, ()):
            own[k, k] += ELSEWHERE_UM**2
        return np.asarray(np.linalg.cholesky(own), dtype=np.float64)

    def _log_variance(self, run: int, label: int) -> float:
        if label == ELSEWHERE:
            return 2.0 * COEFFICIENTS * float(np.log(ELSEWHERE_UM))
        if (run, label) not in self._logs:
            self._logs[run, label] = 2.0 * float(np.sum(np.log(np.diagonal(self._root(run, label)))))
        return self._logs[run, label]

    @cached_property
    def _of_machine(self) -> NDArray[np.float64]:
        """Return effects of the machine's causes on all circles, shape (l, 7, p) [µm]."""
        return self._effects({key for key in self._keys if not key[1]})

    @cached_property
    def _of_session(self) -> NDArray[np.float64]:
        """Return the same of causes that all circles share: the bar, the tool's ball, the plate."""
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
        """Return what has changed since the session before; None without it."""
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
        """Return the covariance of what a circle shares with no other: ball and mounting, shape (7, 7) each [µm²]."""
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


_OTHERWISE = {
    ELSEWHERE: (Name.FORM, "it fits neither its place in the plan nor the other circles"),
    BESIDE: (Name.BORE, "its ball stands elsewhere"),
    LARGER: (Name.RADIUS, "its radius is another"),
}


def _put(labels: tuple[int, ...], changed: Mapping[int, int]) -> tuple[int, ...]:
    return tuple(changed.get(k, label) for k, label in enumerate(labels))


def _key(one: Planned) -> tuple[str, str]:
    return one.test, str(one.circle.direction)
