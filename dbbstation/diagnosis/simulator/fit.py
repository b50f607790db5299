"""Fit a simulator by bounded trust-region least squares from several starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from dbbstation.diagnosis.simulator.terms import IN_PLACE
from dbbstation.diagnosis.simulator.work import AGREE, FittedState, PerturbedParameter
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.triangle import norms, rms

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.model import SimulatorParameter
    from dbbstation.diagnosis.simulator.work import SimulationRuns

    Weigh = Callable[[Floats], Floats]

SPREAD = 0.3
"""Spread of starting values, relative to the parameter, if neither uncertainty nor bounds are stated."""

CLOSE = 1e-5
"""Relative change of the sum of squares that ends a fit: for a thousand rows, a tenth of a standard uncertainty."""

ALIKE = 0.999
"""R² of a parameter's effect on the others' effects above which they are indistinguishable: its uncertainty is then
over thirty times its uncertainty alone."""


@dataclass(frozen=True, eq=False)
class SimulatorFit:
    """Result of a refit.

    Attributes:
        columns: derivatives by fitted parameters, shape (n, m).
    """

    state: FittedState
    residual: Floats
    columns: Floats


def directions_of(work: SimulationRuns, state: FittedState) -> list[PerturbedParameter]:
    """Return a state's parameters with first doses within bounds."""
    low, high = bounds_of(work, state)
    numbers = state.numbers
    keys: list[tuple[str, ...]] = [(p.name,) for p in work.model.parameters]
    sizes = [p.size for p in work.model.parameters]
    for term in state.terms:
        keys += [(term.name, str(k)) for k in range(len(term.numbers))]
        sizes += [abs(number) or 1.0 for number in term.numbers]
    found = []
    for k, (key, size) in enumerate(zip(keys, sizes, strict=True)):
        dose = abs(work.doses.get(key, 1e-3 * size))
        up, down = high[k] - numbers[k], numbers[k] - low[k]
        sign = 1.0 if up >= 2.0 * dose or up >= down else -1.0
        work.doses[key] = sign * dose
        found.append(PerturbedParameter(key, sign * dose, k))
    return found


def bounds_of(work: SimulationRuns, state: FittedState) -> tuple[Floats, Floats]:
    """Return bounds of each parameter, shape (m,)."""
    low = [p.low for p in work.model.parameters]
    high = [p.high for p in work.model.parameters]
    for term in state.terms:
        count, positive = len(term.amplitudes), term.form in IN_PLACE
        shapes = term.bounds or ((-np.inf, np.inf),) * len(term.shape)
        low += [0.0 if positive else -np.inf] * count + [bound[0] for bound in shapes]
        high += [np.inf] * count + [bound[1] for bound in shapes]
    return np.array(low), np.array(high)


def fit(
    work: SimulationRuns,
    start: FittedState,
    weigh: Weigh = lambda rows: rows,
    *,
    sigma: float = 0.0,
    several: bool = False,
) -> SimulatorFit:
    """Fit all parameters [Branch, Coleman and Li, SIAM J. Sci. Comput. 21 (1999) 1].

    Args:
        weigh: transformation of rows, such as whitening, to noise `sigma`.
        sigma: 0 for priors relative to the starting residual.
    """
    begun = work.residuals([start])[0]
    sigma = sigma or rms(weigh(begun)) or 1.0
    starts = [start, *(_elsewhere(work, start, weigh, sigma) if several else ())]
    ended = [_from(work, one, weigh, sigma) for one in starts]
    state, residual = min(ended, key=lambda one: _square(work, one[0], one[1], weigh, sigma))
    answers = work.answers(state, directions_of(work, state), rms(residual))
    return SimulatorFit(state, residual, answers.columns)


def _from(work: SimulationRuns, start: FittedState, weigh: Weigh, sigma: float) -> tuple[FittedState, Floats]:
    low, high = bounds_of(work, start)
    if not len(low):
        return start, work.residuals([start])[0]
    seen: dict[bytes, Floats] = {}

    def residual(numbers: Floats) -> Floats:
        if numbers.tobytes() not in seen:
            seen.clear()
            seen[numbers.tobytes()] = work.residuals([start.with_numbers(numbers)], strict=False)[0]
        return seen[numbers.tobytes()]

    def weighed(numbers: Floats) -> Floats:
        state = start.with_numbers(numbers)
        return _weighed(work, state, residual(numbers), weigh, sigma)

    # Derivatives are recomputed only if they do not predict the last steps.
    about: list[tuple[Floats, Floats, Floats]] = []  # parameters, rows and derivatives at this point

    def columns(numbers: Floats) -> Floats:
        rows = weighed(numbers)
        if about:
            before, rows_before, there = about[-1]
            said = there @ (numbers - before)
            if np.linalg.norm(rows - rows_before - said) < AGREE * np.linalg.norm(said):
                return there
        state = start.with_numbers(numbers)
        found = work.answers(state, directions_of(work, state), rms(residual(numbers)))
        there = np.vstack([-weigh(found.columns) / sigma, _known(work.model.parameters, len(numbers))[0]])
        about[:] = [(numbers.copy(), rows, there)]
        return there

    inside = np.clip(start.numbers, low, high)
    ended = least_squares(
        weighed,
        inside,
        columns,
        bounds=(low, high),
        x_scale="jac",
        ftol=CLOSE,
        xtol=1e-10,
        gtol=1e-12,
        max_nfev=BOUNDS.fit_steps,
    )
    numbers = ended.x
    return start.with_numbers(numbers), residual(numbers)


def _weighed(work: SimulationRuns, state: FittedState, residual: Floats, weigh: Weigh, sigma: float) -> Floats:
    if not np.isfinite(residual).all():
        return np.full(len(weigh(np.zeros(len(residual)))) + len(_known(work.model.parameters, 0)[1]), np.inf)
    rows, stated = _known(work.model.parameters, len(state.numbers))
    return np.concatenate([weigh(residual) / sigma, rows @ state.numbers - stated])


def _known(parameters: Sequence[SimulatorParameter], count: int) -> tuple[Floats, Floats]:
    known = [(k, p) for k, p in enumerate(parameters) if p.uncertainty is not None]
    rows = np.zeros((len(known), max(count, len(parameters))))
    for row, (k, p) in enumerate(known):
        rows[row, k] = 1.0 / p.uncertainty  # type: ignore[operator]  # those without are omitted
    return rows, np.array([p.value / p.uncertainty for _, p in known])  # type: ignore[operator]  # the same


def _square(work: SimulationRuns, state: FittedState, residual: Floats, weigh: Weigh, sigma: float) -> float:
    return float(np.sum(_weighed(work, state, residual, weigh, sigma) ** 2))


def _elsewhere(work: SimulationRuns, start: FittedState, weigh: Weigh, sigma: float) -> list[FittedState]:
    parameters = work.model.parameters
    if not parameters:
        return []
    spread = np.array([2.0 * p.uncertainty if p.uncertainty else SPREAD * p.size for p in parameters])
    low = np.maximum(np.array([p.low for p in parameters]), np.array(start.values) - spread)
    high = np.minimum(np.array([p.high for p in parameters]), np.array(start.values) + spread)
    from scipy.stats import qmc  # noqa: PLC0415 - half a second that no other command needs

    draws = qmc.Sobol(len(parameters), scramble=True, rng=1).random(16)[: BOUNDS.starts]
    states = [FittedState(tuple((low + (high - low) * draw).tolist()), start.terms) for draw in draws]
    left = work.residuals(states, strict=False)
    found = [_square(work, state, rows, weigh, sigma) for state, rows in zip(states, left, strict=True)]
    order = np.argsort(found)[: BOUNDS.gone_on - 1]
    return [states[int(k)] for k in order if np.isfinite(found[int(k)])]


def near(
    work: SimulationRuns, fitted: SimulatorFit, weigh: Weigh, sigma: float, rounds: int = 6
) -> tuple[FittedState, Floats]:
    """Refit to some rows by Gauss-Newton steps with simulations.

    Args:
        weigh: transformation from all rows to whitened fitted rows.
    """
    low, high = bounds_of(work, fitted.state)
    state, residual = fitted.state, fitted.residual
    rows = np.vstack([weigh(fitted.columns) / sigma, -_known(work.model.parameters, len(low))[0]])
    before = _weighed(work, state, residual, weigh, sigma)
    if not rows.shape[1]:
        return state, residual
    scale = norms(rows)
    # Parameters that these rows hardly determine stay, such as the initial state if first rows are held out.
    seen = scale / norms(fitted.columns)
    scale = np.where(seen < HARDLY * seen.max(), np.inf, scale)
    for _ in range(rounds):
        step = np.linalg.lstsq(rows / scale, before, rcond=1e-10)[0] / scale
        share = 1.0
        while share > SMALLEST:
            trial = state.with_numbers(np.clip(state.numbers + share * step, low, high))
            left = work.residuals([trial], strict=False)[0]
            after = _weighed(work, trial, left, weigh, sigma)
            if float(after @ after) < float(before @ before):
                break
            share *= 0.5
        else:
            break
        gain = float(before @ before - after @ after)
        state, residual, before = trial, left, after
        if gain < CLOSE * float(before @ before):
            break
    return state, residual


HARDLY = 1e-4
"""Least ratio of a parameter's information in these rows to all rows, over the largest such ratio, for a determined parameter."""

SMALLEST = 0.1
"""Least tried share of a step; with less, derivatives are invalid or no gain remains."""


def not_told_apart(names: Sequence[str], columns: Floats) -> list[tuple[str, tuple[str, ...]]]:
    """Return indistinguishable parameters, with the parameters that can replace them."""
    norm = np.linalg.norm(columns, axis=0)
    found: list[tuple[str, tuple[str, ...]]] = []
    for k, name in enumerate(names):
        others = [j for j in range(len(names)) if j != k and norm[j] > 0.0]
        if norm[k] == 0.0:
            found.append((name, ()))
        elif others:
            scaled = columns[:, others] / norm[others]
            values = np.linalg.lstsq(scaled, columns[:, k], rcond=1e-12)[0]
            rest = columns[:, k] - scaled @ values
            if 1.0 - float(rest @ rest) / norm[k] ** 2 > ALIKE:
                doing = np.abs(values)
                found.append(
                    (name, tuple(names[others[j]] for j in np.argsort(-doing) if doing[j] > 0.1 * doing.max()))
                )
    return found
