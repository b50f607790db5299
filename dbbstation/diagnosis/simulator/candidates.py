"""Candidate terms at ports: every form over every signal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import BSpline

from dbbstation.diagnosis.simulator.terms import DEGREE, IN_PLACE, Term, TermForm, bends
from dbbstation.diagnosis.simulator.work import sizes
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import NAMED_ODDS
from dbbstation.inference.patterns import DRIVEN_ODDS, log_odds

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.model import SimulatorPort
    from dbbstation.laws.contract import PortSource

ROUNDINGS = (0.01, 0.1)
"""Widths of a sign's transition over the signal's greatest value; integrators step over sharper ones, and wider ones
are curves."""

REACH = 10.0
"""Factor by which a time constant or width may exceed its grid."""

INNER = 2
"""Inner knots of a smooth curve: a cubic spline with four functions in addition to a straight line."""

PERIODS = {"rad": 2.0 * np.pi, "deg": 360.0, "turn": 1.0}
"""One turn of an angle, by its unit."""

DISTINCT = 3
"""Fewest different values of a signal for terms other than a constant."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A possible missing term.

    Attributes:
        term: with zero amplitude and mid-grid parameters.
        tried: tried sizes for forms that replace a signal; else empty.
        driven: signals that result from the simulation.
    """

    term: Term
    names: tuple[str, ...]
    units: tuple[str, ...]
    grids: tuple[tuple[float, ...], ...]
    log_odds: float
    positive: tuple[bool, ...]
    tried: tuple[float, ...] = ()
    driven: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """Return the term's name."""
        return self.term.name


def candidates(
    ports: Sequence[SimulatorPort],
    signals: Mapping[str, Mapping[str, Floats]],
    own: Sequence[PortSource] = (),
    times: Floats | None = None,
) -> tuple[Candidate, ...]:
    """Return every form at every port.

    Args:
        signals: of all calls, with `t`, by port and name, shape (calls,).
        times: of the longest run, ascending, shape (n,), for time constants.
    """
    found: list[Candidate] = []
    for port in ports:
        at = signals[port.name]
        if len(at["t"]):
            span = _span(at["t"] if times is None else times)
            found += _at(port, {s: at[s] for s in port.signals if len(np.unique(at[s])) >= DISTINCT}, span)
    for source in own:
        parameters = source.parameters()
        amplitudes, shaped = [p for p in parameters if not p.grid], [p for p in parameters if p.grid]
        middle = tuple(p.grid[len(p.grid) // 2] for p in shaped)
        term = Term(source.port, TermForm.OWN, (), (0.0,) * len(amplitudes), middle, own=source)
        names, units = (tuple(getattr(p, of) for p in (*amplitudes, *shaped)) for of in ("name", "unit"))
        signs = tuple(p.positive for p in amplitudes)
        found.append(Candidate(term, names, units, tuple(p.grid for p in shaped), NAMED_ODDS, signs))
    count = {form: sum(one.term.form is form for one in found) for form in TermForm}
    results = {(port.name, signal) for port in ports for signal in port.results}
    return tuple(one if one.term.own else _weighed(one, count[one.term.form], results) for one in found)


def _weighed(one: Candidate, members: int, results: Collection[tuple[str, str]]) -> Candidate:
    """Return a candidate with its prior odds among candidates of its form; signals that result from the simulation have lower odds."""
    driven = frozenset(signal for signal in one.term.signals if (one.term.port, signal) in results)
    return replace(one, log_odds=log_odds(members) + (DRIVEN_ODDS if driven else 0.0), driven=driven)


def _span(times: Floats) -> tuple[float, float]:
    steps = np.diff(np.unique(times))
    return float(np.median(steps)), float(times.max() - times.min())


def _at(port: SimulatorPort, signals: Mapping[str, Floats], span: tuple[float, float]) -> list[Candidate]:
    """Yield a port's terms over varying signals, shape (calls,)."""
    found = [_candidate(port, (), TermForm.CONSTANT, ("value",), (port.unit,))]
    greatest = sizes(signals)
    for name, values in signals.items():
        unit, size, both_signs = port.signals[name], greatest[name], values.min() < 0.0 < values.max()
        of, per = partial(_candidate, port, (name,)), _per(port.unit, unit)
        if unit in PERIODS and np.ptp(values) >= PERIODS[unit]:
            both = ("cosine", "sine"), (port.unit,) * 2
            found += [of(TermForm.PERIODIC, *both, (PERIODS[unit], order)) for order in (1.0, 2.0)]
        for form, power in ((TermForm.LINEAR, ""), (TermForm.SQUARE, "²"), (TermForm.DRAG, "²"), (TermForm.CUBIC, "³")):
            if form is not TermForm.DRAG or both_signs:
                found.append(of(form, ("coefficient",), (_per(port.unit, unit, power),)))
        if len(inside := inner_quantiles(values, BOUNDS.answer_lengths)):
            found.append(of(TermForm.CURVE, *_curve(port, values)))
            hinge = of(TermForm.HINGE, ("slope", "place"), (per, unit), grid=inside)
            # A hinge outside the signal's range has no effect, so its values are undetermined.
            reached = (float(values.min()), float(values.max()))
            found.append(replace(hinge, term=replace(hinge.term, bounds=(reached,))))
        constants = _grid(2.0 * span[0], max(span[1] / 3.0, 4.0 * span[0]))
        found.append(of(TermForm.MEMORY, ("gain", "time constant"), (per, "s"), grid=constants))
        if both_signs:
            turns = tuple(share * size for share in ROUNDINGS)
            found.append(of(TermForm.SIGN, ("size", "rounding"), (port.unit, unit), grid=turns))
            widths = tuple((size * np.geomspace(0.03, 0.6, BOUNDS.answer_lengths)).tolist())
            found.append(of(TermForm.LIMIT, ("slope", "half width"), (per, unit), grid=widths))
        widths = tuple((0.5 * float(np.ptp(values)) * np.geomspace(0.01, 0.5, BOUNDS.answer_lengths)).tolist())
        found.append(of(TermForm.SLIP, ("size", "half width"), (port.unit, unit), grid=widths))
        if unit == port.unit:
            whiles = _grid(span[0], max(0.1 * span[1], 2.0 * span[0]), 1)
            waiting = [(TermForm.DELAY, "dead time"), (TermForm.LAG, "time constant")]
            found += [replace(of(form, (what,), ("s",)), tried=whiles) for form, what in waiting]
            lost = [TermForm.PLAY, TermForm.GAP] if both_signs else [TermForm.PLAY]
            found += [replace(of(form, ("half width",), (unit,)), tried=widths) for form in lost]
    for one, other in combinations(signals, 2):
        units = _per(_per(port.unit, port.signals[one]), port.signals[other])
        found.append(_candidate(port, (one, other), TermForm.PRODUCT, ("coefficient",), (units,)))
    return found


def _grid(least: float, most: float, more: int = 0) -> tuple[float, ...]:
    return tuple(np.geomspace(least, most, BOUNDS.answer_lengths + more).tolist())


def _candidate(
    port: SimulatorPort,
    signals: tuple[str, ...],
    form: TermForm,
    names: tuple[str, ...],
    units: tuple[str, ...],
    fixed: tuple[float, ...] = (),
    grid: tuple[float, ...] = (),
) -> Candidate:
    count = len(names) - bool(grid)
    middle = (grid[len(grid) // 2],) if grid else ()
    bounds = ((grid[0] / REACH, grid[-1] * REACH),) if grid and form is not TermForm.HINGE else ()
    return Candidate(
        Term(port.name, form, signals, (0.0,) * count, middle, fixed, bounds=bounds),
        names,
        units,
        (grid,) if grid else (),
        0.0,
        (form in IN_PLACE,) * count,
    )


def inner_quantiles(values: Floats, count: int) -> tuple[float, ...]:
    """Return a signal's distinct inner quantiles, ascending; may be empty."""
    every = np.unique(np.quantile(values, np.linspace(0.0, 1.0, count + 2)[1:-1]))
    return tuple(every[(every > values.min()) & (every < values.max())].tolist())


def _curve(port: SimulatorPort, values: Floats) -> tuple[tuple[str, ...], tuple[str, ...], tuple[float, ...]]:
    low, high = float(values.min()), float(values.max())
    room = 0.05 * (high - low)
    inner = inner_quantiles(values, INNER)
    knots = np.concatenate([[low - room] * 4, inner, [high + room] * 4])
    count = len(knots) - DEGREE - 3
    return tuple(f"bend {k + 1}" for k in range(count)), (port.unit,) * count, tuple(knots.tolist())


def _per(unit: str, other: str, power: str = "") -> str:
    return f"{unit or '1'}/{f'({other})' if ' ' in other or '/' in other else other}{power}" if other else unit


def basis(term: Term, values: Floats) -> Floats:
    """Return a curve's basis functions at signal values, shape (n, p)."""
    inside = np.clip(values, term.fixed[0], term.fixed[-1])
    splines = BSpline.design_matrix(inside, np.array(term.fixed), DEGREE).toarray()
    return splines @ bends(term.fixed)
