"""Effects of shared causes on a plan's circles, and a run compared with each circle."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.quality.forms import FIRST_COSINE, FIRST_SINE
from dbbstation.quality.together import expected_um, read_um
from dbbstation.trace.expected import COEFFICIENTS, along_travel

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.quality.knowledge import Planned, Seen

ELSEWHERE_UM = 1e3
"""Standard deviation per coefficient of a run that is no circle of the plan: a bar's travel is millimetres [µm]."""

ELSEWHERE, BESIDE, LARGER = -1, -2, -3
"""Labels: no circle of the plan, the planned circle about another place, and the planned circle with another radius."""

ANYWHERE_UM = 1e4
"""Standard deviation of a centre without information [µm]."""


class PlanEffects:
    """The circles of a plan with the effects of shared causes, cached for a session.

    Args:
        owns: how many times a circle's own variance counts: 1 in this session, 2 if compared with a previous session.
    """

    def __init__(self, circles: Sequence[Planned], owns: int = 1) -> None:
        self.circles = circles
        self._owns = owns
        self._runs: dict[Seen, RunEffects] = {}

    def run(self, one: Seen) -> RunEffects:
        """Return a run compared with each circle, cached."""
        if one not in self._runs:
            planned = self.labels[one.run.test, one.run.circle.direction]
            late_um2 = _late_um2(one, self.circles[planned], [*self._runs, one])
            self._runs[one] = RunEffects(self, one, planned, late_um2)
        return self._runs[one]

    @cached_property
    def labels(self) -> Mapping[tuple[str, str], int]:
        """Return the indices of the plan's circles by test and direction."""
        return {key_of(one): k for k, one in enumerate(self.circles)}

    @cached_property
    def shared(self) -> Floats:
        """Return effects of shared causes on all circles, then zeros for no circle, shape (l + 1, 7, p) [µm]."""
        columns = np.concatenate([self.of_machine, self.of_session], axis=2)
        return np.concatenate([columns, np.zeros_like(columns[:1])])

    def scale(self, size: float) -> Floats:
        """Return the standard deviations of shared causes for one size of machine errors, shape (p,)."""
        return np.repeat([size, 1.0], [self.of_machine.shape[2], self.of_session.shape[2]])

    @cached_property
    def of_machine(self) -> Floats:
        """Return effects of machine causes on all circles, shape (l, 7, p) [µm]."""
        return self._effects({key for key in self._keys if not key[1]})

    @cached_property
    def of_session(self) -> Floats:
        """Return effects of causes common to all circles, without the machine's: bar, tool ball, plate."""
        return self._effects({key for key in self._of_all if key[1]})

    @cached_property
    def _keys(self) -> tuple[tuple[str, str], ...]:
        return tuple(dict.fromkeys(key for one in self.circles for key in one.expected.effects_um))

    @cached_property
    def _of_all(self) -> frozenset[tuple[str, str]]:
        keys = [set(one.expected.effects_um) for one in self.circles]
        return frozenset(set.intersection(*keys))

    def _effects(self, wanted: set[tuple[str, str]]) -> Floats:
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
        # Rotate the parameters to as few as needed; the others have no effect.
        u, sizes, _ = np.linalg.svd(stacked, full_matrices=False)
        kept = sizes > 1e-6 * max(float(sizes.max(initial=0.0)), 1e-9)
        return (u[:, kept] * sizes[kept]).reshape(len(self.circles), COEFFICIENTS, -1)

    @cached_property
    def own(self) -> list[Floats]:
        """Return the covariance of each circle's own part (ball and mounting), shape (7, 7) each [µm²]."""
        found = []
        for one in self.circles:
            effects = [e for key, e in one.expected.effects_um.items() if key[1] and key not in self._of_all]
            signs = along_travel(one.circle)[:, None]
            joined = signs * np.hstack([np.zeros((COEFFICIENTS, 1)), *effects])
            own = float(self._owns) * joined @ joined.T
            own += 1e-6 * np.eye(COEFFICIENTS)
            if not one.expected.place_known:
                own[[FIRST_COSINE, FIRST_SINE], [FIRST_COSINE, FIRST_SINE]] += ANYWHERE_UM**2
            found.append(own)
        return found


class RunEffects:
    """A run compared with each circle of the plan, and with none of them.

    Args:
        planned: label of the circle under which the run was filed.
        late_um2: variance of each coefficient by what changed since the session began.

    """

    def __init__(self, plan: PlanEffects, one: Seen, planned: int, late_um2: float) -> None:
        self._plan, self._one = plan, one
        self._noise_um2 = one.u_um**2 + late_um2
        self.planned = planned
        self._products: dict[int, Floats] = {}

    def shows(self, labels: ArrayLike) -> Integers:
        """Return each label's circle, whose effects the run then has; the last index means no circle."""
        labels = np.asarray(labels)
        own = np.where(labels == ELSEWHERE, len(self._plan.circles), self.planned)
        return np.where(labels >= 0, labels, own)

    def product(self, label: int) -> Floats:
        """Return inner products of whitened effects and readings, shape (p + 1, p + 1)."""
        if label not in self._products:
            root = np.linalg.cholesky(self.scatter[label])
            read = np.column_stack([self._plan.shared[self.shows(label)], self.off[label]])
            white = np.linalg.solve(root, read)
            self._products[label] = white.T @ white
            self._products[label][-1, -1] += 2.0 * self.half_log_determinants[label]
        return self._products[label]

    @cached_property
    def off(self) -> Floats:
        """Return the reading minus expectation by label, shape (l + 3, 7) [µm]."""
        expected = np.array([expected_um(one) for one in self._plan.circles])
        return read_um(self._one) - expected[[*range(len(expected)), *[self.planned] * 3]]

    @cached_property
    def scatter(self) -> Floats:
        """Return the covariance of the reading's own part by label, shape (l + 3, 7, 7) [µm²]."""
        own = self._plan.own
        by_label = np.array([*own, *[own[self.planned]] * 3]) + self._noise_um2 * np.eye(COEFFICIENTS)
        by_label[ELSEWHERE] = ELSEWHERE_UM**2 * np.eye(COEFFICIENTS)
        for k in (FIRST_COSINE, FIRST_SINE):
            by_label[BESIDE, k, k] += ELSEWHERE_UM**2
        by_label[LARGER, 0, 0] += ELSEWHERE_UM**2
        return by_label

    @cached_property
    def half_log_determinants(self) -> Floats:
        """Return half the log determinants of `scatter`, shape (l + 3,)."""
        return log_diagonal(np.linalg.cholesky(self.scatter))


def _late_um2(one: Seen, begun: Planned, known: Sequence[Seen]) -> float:
    """Return the variance of a run's coefficients since the session began, as if it were the same in all.

    Causes that vary with time have their usual size. The reading may have drifted as fast as overlaps of known runs show.

    Args:
        begun: the run's circle as it would be at the session's begin.
    """
    late_um2 = begun.expected.late_um2 if one.run.expected is None else one.run.expected.late_um2
    usual = max(float(np.linalg.eigvalsh(late_um2 - begun.expected.late_um2)[-1]), 0.0)
    rate2 = float(np.mean([each.drift_um_s**2 for each in known]))
    return usual + rate2 * (one.run.started_s or 0.0) ** 2


def log_diagonal(roots: NDArray[np.floating]) -> Floats:
    """Return half the log determinants of matrices, from their Cholesky factors."""
    return np.asarray(np.sum(np.log(np.diagonal(roots, axis1=-2, axis2=-1)), axis=-1))


def key_of(one: Planned) -> tuple[str, str]:
    """Return test and direction of a circle."""
    return one.test, str(one.circle.direction)
