"""Do intervals of circle figures contain the truth? Serial machines of `tests/plant`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import binom

from dbbstation.circles.analysis import CircleAnalysis, analyse, analyse_pair, refiltered
from dbbstation.circles.budget import RANGES, Budget, SetUpKnowledge, budgets, pair_budgets
from dbbstation.circles.estimates import ABSOLUTE, BudgetQuantity
from dbbstation.circles.path import Filter
from dbbstation.circles.quick_look import Signature, quick_look
from dbbstation.plan.bar import Bar
from dbbstation.plan.plan import Circle, Direction
from dbbstation.plan.tolerance import CircleFigure
from dbbstation.results.tolerances import sizes_of
from dbbstation.trace.recording import RawCircle
from studies.coverage_rows import LEAST, MOST
from studies.kept_draws import drawn
from tests.plant.noise import Noise
from tests.plant.serial import Axis, SerialMachine

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

COVERAGE_FACTOR = 2.0
"""k of U = k u, as it is printed."""

SAMPLES = 720
RADIUS_MM, FEED_MM_MIN = 150.0, 1000.0
BAR = Bar("study", RADIUS_MM, 0.0005, None, 20.0, 11.5, temp_uncertainty_k=0.3)
SHOP_DEGC = 28.0
U_BALL_UM = 1.0
UNKNOWN = SetUpKnowledge(not_absolute="not absolute, because the session does not state: calibrated length of the bar")

LEVELS_UM = (0.1, 0.3, 1.0)
COLOURS = {"white": (1.0, 0.0), "correlated": (0.6, 0.8)}
"""Shares of white noise and of noise that remembers eight tenths of the sample before."""

KINDS = ("perfect", "as large as noise", "worn machine")
"""Faults: none, such that the form is about as large as the noise, and those of a worn machine."""

FILTERS = (Filter.UPR_15, Filter.UPR_50, Filter.UPR_150)
GAUSSIAN, SHARP = "Gaussian filters", "30 UPR"
RAISED_DEG = 30.0
"""Of the bar of every fifth machine."""
SURE = "printed without U"

CHANCE = 1e-4
"""Chance at which a row that is as promised counts as not."""

RANGES_OF_CIRCLES = ("G", "G(LS)", "G(b)", "G(b)(LS)", "H")
_NOISE_OR_FORM = (
    "U holds that all of the spectrum is noise and that only its end is; intervals of small ranges reach to zero"
)
REASONS = {
    **dict.fromkeys(
        [
            *RANGES_OF_CIRCLES,
            *(
                f"{figure}, {filtered}"
                for figure in (*RANGES_OF_CIRCLES, "Fmax", "Fmin")
                for filtered in (GAUSSIAN, SHARP)
            ),
        ],
        _NOISE_OR_FORM,
    ),
    "reversal step": "noise that is seen beside steps counts as slow",
    "closure": "noise that is seen beside steps counts as slow",
    "reversal spike": "U holds spikes of all lengths that may be",
    "cyclic error": "seen from a wave that noise shows in one of a thousand scans",
    "cyclic error, not seen: below": "the bound is that of the strongest of all waves that are tried",
}
"""Why more than 97 % of the intervals of a figure hold the truth."""


@dataclass(frozen=True)
class Cell:
    """One noise.

    Attributes:
        colour: `white` or `correlated`.
    """

    level_um: float
    colour: str

    @property
    def noise(self) -> Noise:
        """Return the plant's noise."""
        white, correlated = COLOURS[self.colour]
        return Noise(self.level_um * white, self.level_um * correlated, 0.8)

    @property
    def name(self) -> str:
        """Return its name in a table."""
        return f"{self.colour} {self.level_um:g} µm"


CELLS = tuple(Cell(level, colour) for colour in COLOURS for level in LEVELS_UM)


def coverage_of_circles(
    draws: int,
    seed: int,
    progress: Callable[[int], None],
    cells: Sequence[Cell] = CELLS,
    keep: Path | None = None,
) -> dict[str, Any]:
    """Draw circles and count how often U contains the truth.

    Args:
        draws: per noise, three kinds of circles in turn.
        cells: noises, in turn.
        keep: file of draws, or None.
    """
    counts: dict[str, dict[str, Any]] = {}
    what = f"figures of circles, {', '.join(cell.name for cell in cells)}, from seed {seed}"
    results = drawn(partial(_numbered, tuple(cells), seed), range(draws * len(cells)), keep, what)
    for number, result in enumerate(results):
        cell, kind = cells[number % len(cells)], _kind(seed + number // len(cells))
        for figure, inside in result:
            row = counts.setdefault(figure, {}).setdefault(cell.name, {})
            count = row.setdefault(kind, {"inside": 0, "draws": 0})
            count["inside"] += inside
            count["draws"] += 1
        progress(number + 1)
    found = {"draws": draws, "rows": counts, "reasons": REASONS}
    return found | {"faults": faults_of(found)}


def _numbered(cells: Sequence[Cell], seed: int, number: int) -> list[tuple[str, bool]]:
    return _drawn(cells[number % len(cells)], seed + number // len(cells))


def _kind(seed: int) -> str:
    return KINDS[seed % len(KINDS)]


def faults_of(found: dict[str, Any]) -> list[str]:
    """Return rows that break their promise beyond chance."""
    faults = []
    for figure, row in found["rows"].items():
        inside, of = pooled(row)
        if SURE in figure:
            if inside < of:
                faults.append(f"{figure}: {of - inside} of {of} are not")
        elif binom.cdf(inside, of, LEAST) < CHANCE:
            faults.append(f"{figure}: only {100 * inside / of:.1f} % inside")
        elif binom.sf(inside - 1, of, MOST) < CHANCE and figure not in REASONS:
            faults.append(f"{figure}: {100 * inside / of:.1f} % inside, and no reason beside it")
    return faults


def pooled(row: dict[str, Any], noise: str = "", kind: str = "") -> tuple[int, int]:
    """Return intervals of a row that hold the truth, and all; of one noise or kind if given."""
    chosen = [
        counts
        for name, kinds in row.items()
        for which, counts in kinds.items()
        if noise in ("", name) and kind in ("", which)
    ]
    return sum(c["inside"] for c in chosen), sum(c["draws"] for c in chosen)


def _drawn(cell: Cell, seed: int) -> list[tuple[str, bool]]:
    """Return rows of one machine's circle in both directions."""
    rng = np.random.default_rng([seed, int(1000 * cell.level_um), len(cell.colour)])
    size = dict(zip(KINDS, (0.0, 0.3 * cell.level_um, 1.0), strict=True))[_kind(seed)]
    machine = _machine(rng, size)
    centre_mm = 0.02 * size * rng.standard_normal(2)
    radius_um = 5.0 * size * rng.standard_normal()
    ball_mm = 1e-3 * U_BALL_UM * rng.standard_normal(2)
    long_mm = BAR.calibrator_uncertainty_mm * rng.standard_normal()
    degc = 0.3 * rng.standard_normal(2)
    grown_mm = 1e-6 * 11.5 * (1.0 + 0.05 * rng.standard_normal()) * RADIUS_MM * (SHOP_DEGC - 20.0 + degc[0] - degc[1])
    read_long_mm, _ = BAR.reads_long_mm(SHOP_DEGC)
    true, read = [], []
    raised_deg = RAISED_DEG if seed % 5 == 0 else 0.0
    for direction in Direction:
        silent = _turn(machine, direction, tuple(-centre_mm), radius_um, raised_deg)
        about = _turn(machine, direction, tuple(ball_mm - centre_mm), radius_um, raised_deg)
        true.append(analyse(silent))
        noisy = about.length_mm + cell.noise.drawn_mm(rng, SAMPLES) + long_mm - grown_mm - read_long_mm
        read.append(analyse(replace(about, length_mm=noisy)))
    known = SetUpKnowledge(
        u_bar_um=1e3 * BAR.calibrator_uncertainty_mm,
        u_temperature_um=1e3 * (BAR.grown_uncertainty_mm(SHOP_DEGC) or 0.0),
        u_ball_um=U_BALL_UM,
        u_ball_z_um=U_BALL_UM,
    )
    found = [*_of_one(read[0], true[0], known, seed), *_of_both(read, true, known, seed)]
    return [(figure, bool(inside)) for figure, inside in (*found, *_of_look(read, machine))]


def _machine(rng: np.random.Generator, size: float) -> SerialMachine:
    def axis(late_ms: float, scale_um_m: float) -> Axis:
        play, spikes = size * 2.0 * rng.standard_normal(2), size * rng.standard_normal(2)
        return Axis(
            late_ms=late_ms,
            scale_um_m=scale_um_m,
            plus_um=float(play[0]),
            minus_um=float(play[1]),
            spike_plus_um=float(spikes[0]),
            spike_minus_um=float(spikes[1]),
            cyclic_um=size * float(rng.uniform(0.0, 1.0)),
            period_mm=2.0 * RADIUS_MM / float(rng.uniform(8.0, 38.0)),
            phase_rad=float(rng.uniform(0.0, 2.0 * np.pi)),
        )

    late, scale, square = size * np.array([0.1, 50.0, 100.0]) * rng.standard_normal(3)
    return SerialMachine(
        axis(float(late), float(scale)), axis(-float(late), -float(scale)), float(square), float(rng.uniform(2.0, 10.0))
    )


def _turn(
    machine: SerialMachine, direction: Direction, ball_mm: tuple[float, ...], radius_um: float, raised_deg: float
) -> RawCircle:
    """Return a machine's turn about a ball, raised ones smaller and higher."""
    circle = Circle((0, 0, 0), (0, 0, 0), RADIUS_MM, (0, 0, 0), FEED_MM_MIN, 0.0, 0.0, 1.5, raised_deg, direction)
    phi_deg = np.arange(0.0, 360.0, 360.0 / SAMPLES)
    radius_mm = RADIUS_MM * float(np.cos(np.radians(raised_deg)))
    along_mm = machine.length_mm(
        circle.theta_deg(phi_deg), radius_mm, FEED_MM_MIN, int(direction.sign), (ball_mm[0], ball_mm[1])
    )
    length_mm = np.hypot(along_mm + 1e-3 * radius_um, RADIUS_MM * np.sin(np.radians(raised_deg)))
    return RawCircle(str(direction), circle, phi_deg / circle.turning_deg_s, phi_deg, length_mm)


def _of_one(read: CircleAnalysis, true: CircleAnalysis, known: SetUpKnowledge, seed: int) -> Iterator[tuple[str, bool]]:
    for quantity, budget in budgets(read, known).items():
        yield from _stated(budget, _truth(true, quantity), read)
    for quantity in sorted(ABSOLUTE - {BudgetQuantity.D}):
        nothing = budgets(read, UNKNOWN, [quantity])[quantity]
        yield f"{_row(quantity)}, bar not known: {SURE}", nothing.u_um is None
    for chosen, name in _filters(seed):
        filtered, filtered_true = refiltered(read, chosen), refiltered(true, chosen)
        for quantity, budget in budgets(filtered, known, RANGES).items():
            yield from _stated(budget, _truth(filtered_true, quantity), read, f", {name}")
    size = sizes_of(refiltered(read, Filter.UPR_30), known)[CircleFigure.CENTRE_DEVIATION]
    yield "centre deviation", abs(size.um - 1e3 * float(np.hypot(*true.centre_mm))) <= COVERAGE_FACTOR * size.known_um
    for step, true_step in zip(read.steps, true.steps, strict=True):
        yield "reversal step", abs(step.height_um - true_step.height_um) <= COVERAGE_FACTOR * step.u_um
    if read.closure is not None and true.closure is not None:
        apart_um = abs(read.closure.height_um - true.closure.height_um)
        yield "closure", apart_um <= COVERAGE_FACTOR * read.closure.u_um


def _filters(seed: int) -> tuple[tuple[Filter, str], ...]:
    return (FILTERS[seed % len(FILTERS)], GAUSSIAN), (Filter.UPR_30, SHARP)


def _of_both(
    read: Sequence[CircleAnalysis], true: Sequence[CircleAnalysis], known: SetUpKnowledge, seed: int
) -> Iterator[tuple[str, bool]]:
    for chosen, name in ((Filter.NONE, ""), *_filters(seed)):
        of_true = analyse_pair(*(refiltered(one, chosen) for one in true))
        truth = {
            BudgetQuantity.G_BOTH: of_true.g_um,
            BudgetQuantity.G_BOTH_LS: of_true.g_least_squares_um,
            BudgetQuantity.D: of_true.d_um,
            BudgetQuantity.H: of_true.h_um,
        }
        for quantity, budget in pair_budgets(analyse_pair(*(refiltered(one, chosen) for one in read)), known).items():
            if quantity is not BudgetQuantity.D or not chosen:
                yield from _stated(budget, truth[quantity], read[0], f", {name}" if name else "")


def _stated(budget: Budget, truth_um: float, read: CircleAnalysis, what: str = "") -> Iterator[tuple[str, bool]]:
    """Return a figure's row; a raised bar's radius has no U."""
    row = _row(budget.quantity) + what
    if read.raw.circle.elevation_deg and budget.quantity in ABSOLUTE - {BudgetQuantity.MEAN_RADIAL}:
        yield f"{row}, bar raised: {SURE}", budget.u_um is None
    else:
        yield row, _holds(budget, truth_um)


def _of_look(read: Sequence[CircleAnalysis], machine: SerialMachine) -> Iterator[tuple[str, bool]]:
    look = quick_look(read)
    if look is None:
        return
    x, y = machine.x, machine.y
    truth = {
        (Signature.SQUARENESS, ""): machine.square_um_m,
        (Signature.SCALE, ""): x.scale_um_m - y.scale_um_m,
        (Signature.SERVO, ""): x.late_ms - y.late_ms,
    }
    for axis, name in ((x, "X"), (y, "Y")):
        truth |= {
            (Signature.BACKLASH, f"+{name}"): axis.plus_um,
            (Signature.BACKLASH, f"-{name}"): axis.minus_um,
            (Signature.SPIKE, f"+{name}"): axis.spike_plus_um,
            (Signature.SPIKE, f"-{name}"): axis.spike_minus_um,
            (Signature.CYCLIC, name): axis.cyclic_um,
        }
    for one in look.symptoms:
        true = truth[one.signature, one.place]
        if one.value is not None and one.u is not None:
            yield str(one.signature), abs(one.value - true) <= COVERAGE_FACTOR * one.u
        elif one.below is not None:
            yield f"{one.signature}, not seen: below", true <= one.below


def _row(quantity: BudgetQuantity) -> str:
    return "centre" if quantity in {BudgetQuantity.X, BudgetQuantity.Y} else str(quantity)


def _truth(true: CircleAnalysis, quantity: BudgetQuantity) -> float:
    return {
        BudgetQuantity.G: true.g_um,
        BudgetQuantity.G_LS: true.g_least_squares_um,
        BudgetQuantity.F_MAX: true.f_centred.largest_um,
        BudgetQuantity.F_MIN: true.f_centred.least_um,
        BudgetQuantity.RADIUS: true.radius_error_um,
        BudgetQuantity.MEAN_RADIAL: true.mean_radial_error_um,
        BudgetQuantity.X: 1e3 * true.centre_mm[0],
        BudgetQuantity.Y: 1e3 * true.centre_mm[1],
    }[quantity]


def _holds(budget: Budget, truth_um: float) -> bool:
    return budget.u_um is not None and abs(budget.value_um - truth_um) <= COVERAGE_FACTOR * budget.u_um
