"""Do intervals hold under unmodelled noise? Circles with `tests/plant/other_noise.py`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.circles.analysis import analyse, analyse_pair
from dbbstation.circles.budget import SetUpKnowledge, budgets, pair_budgets
from dbbstation.circles.estimates import BudgetQuantity
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.recording import RawCircle
from studies.coverage_rows import row_of
from studies.kept_draws import drawn
from tests.plant.other_noise import KINDS, STEP

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from studies.coverage_rows import Row

COVERAGE_FACTOR = 2.0
"""k of U = k u, as it is printed."""

SAMPLES, RADIUS_MM = 720, 150.0
LEVEL_UM = 0.3

KNOWN = SetUpKnowledge(u_bar_um=0.0, u_temperature_um=0.0, u_ball_um=0.0, u_ball_z_um=0.0)
"""Bar and ball are exact: nothing but noise is looked at, and nothing covers what it lacks."""

LOBES_UM = ((2, 1.5, 0.3), (3, 0.7, 0.0), (5, 0.3, 0.0))
"""Undulations, amplitude [µm], phase [rad] of every other pair; the others are perfect circles."""

OF_ONE = (BudgetQuantity.G, BudgetQuantity.G_LS, BudgetQuantity.F_MAX, BudgetQuantity.RADIUS, BudgetQuantity.X)
OF_BOTH = (BudgetQuantity.G_BOTH, BudgetQuantity.D, BudgetQuantity.H)

ONE_TURN = "one turn does not tell slow noise from form, nor one law of noise from another: U holds all that may be"
REASONS = dict.fromkeys(KINDS, ONE_TURN)
"""Why more than 97 % may be inside, by noise."""

Values = dict[str, tuple[float, float]]
"""Found less true value and stated standard uncertainty by figure [µm]."""


def coverage_of_noises(
    draws: int,
    seed: int,
    progress: Callable[[int], None],
    kinds: Sequence[str] = tuple(KINDS),
    keep: Path | None = None,
) -> list[Row]:
    """Draw circles in both directions and count how often U = 2 u contains the truth.

    Args:
        draws: pairs of turns, noises in turn.
        kinds: of `tests.plant.other_noise.KINDS`.
        keep: file of draws, or None.
    """
    what = f"other noises, {', '.join(kinds)}, from seed {seed}"
    found: dict[str, list[Values]] = {kind: [] for kind in kinds}
    results = drawn(partial(_numbered, tuple(kinds), seed), range(draws * len(kinds)), keep, what)
    for number, result in enumerate(results):
        found[kinds[number % len(kinds)]].append(result)
        progress(number + 1)
    return [row for kind, values in found.items() for row in _rows(kind, values)]


def _rows(kind: str, values: Sequence[Values]) -> list[Row]:
    rows = []
    for quantity in (*OF_ONE, *OF_BOTH):
        off, u = (np.array([[value[quantity.value][k]] for value in values]) for k in (0, 1))
        rows.append(row_of(f"{kind} {LEVEL_UM:g} µm", str(quantity), off, u, "µm", REASONS[kind], COVERAGE_FACTOR))
    return rows


def _numbered(kinds: Sequence[str], seed: int, number: int) -> dict[str, Any]:
    return drawn_values(kinds[number % len(kinds)], seed + number // len(kinds))


def drawn_values(kind: str, seed: int) -> Values:
    """Return a pair of turns under a noise."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind), 29])
    silent = [_turn(direction, lobes=seed % 2 > 0) for direction in Direction]
    truth = analyse_pair(*(analyse(raw) for raw in silent))
    read = [analyse(replace(raw, length_mm=_read_mm(raw.length_mm, kind, rng))) for raw in silent]
    found = budgets(read[0], KNOWN, OF_ONE) | pair_budgets(analyse_pair(*read), KNOWN)
    one = truth.one
    true = {
        BudgetQuantity.G: one.g_um,
        BudgetQuantity.G_LS: one.g_least_squares_um,
        BudgetQuantity.F_MAX: one.f_centred.largest_um,
        BudgetQuantity.RADIUS: one.radius_error_um,
        BudgetQuantity.X: 1e3 * one.centre_mm[0],
        BudgetQuantity.G_BOTH: truth.g_um,
        BudgetQuantity.D: truth.d_um,
        BudgetQuantity.H: truth.h_um,
    }
    return {q.value: (found[q].value_um - true_um, found[q].known_um) for q, true_um in true.items()}


def _turn(direction: Direction, *, lobes: bool) -> RawCircle:
    circle = Circle((0, 0, 0), (0, 0, 0), RADIUS_MM, (0, 0, 0), 1000.0, 0.0, 0.0, 1.5, 0.0, direction)
    phi_deg = np.arange(0.0, 360.0, 360.0 / SAMPLES)
    theta = np.radians(circle.theta_deg(phi_deg))
    form_um = np.zeros(SAMPLES)
    for undulations, size_um, phase in LOBES_UM if lobes else ():
        form_um += size_um * np.cos(undulations * theta + phase)
    return RawCircle(str(direction), circle, phi_deg / circle.turning_deg_s, phi_deg, RADIUS_MM + 1e-3 * form_um)


def _read_mm(length_mm: NDArray[np.float64], kind: str, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return lengths with noise, rounded if the gauge is coarse, shape (n,) [mm]."""
    read = length_mm + 1e-3 * LEVEL_UM * KINDS[kind](rng, SAMPLES)
    step_mm = 1e-3 * LEVEL_UM * STEP.get(kind, 0.0)
    return np.round(read / step_mm) * step_mm if step_mm else read
