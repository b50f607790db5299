"""Candidate terms as laws, with simulated responses to small doses as columns."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from dbbstation.computing.grouped import grouped
from dbbstation.diagnosis.simulator.terms import MEMORIES, TermForm
from dbbstation.diagnosis.simulator.work import AGREE, PerturbedParameter
from dbbstation.inference.channel import Law
from dbbstation.inference.square_root import slices
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.candidates import Candidate
    from dbbstation.diagnosis.simulator.work import FittedState, SimulationRuns
    from dbbstation.inference.channel import Discrepancy

    Departures = Mapping[tuple[str, TermForm, tuple[str, ...]], Floats]

FORM_UNCERTAINTY = 0.02
"""Relative standard deviation of real objects from a form, as for springs and geometry in `TableSource`."""

LOOSE_FORM_UNCERTAINTY = 0.1
"""The same for friction, play and memory."""

LOOSE = frozenset({TermForm.SIGN, TermForm.SLIP, TermForm.PLAY, TermForm.MEMORY})


CURVED_MOST = 3.0 * AGREE
"""Relative difference between responses to two doses that excludes a candidate as too nonlinear."""


def laws(
    work: SimulationRuns,
    state: FittedState,
    found: Sequence[Candidate],
    size: float,
) -> tuple[list[Law], dict[str, str]]:
    """Return candidates as laws linearised about a state, and reasons against other candidates."""
    dosed = [one for one in found if not one.tried]
    points = [(one, point) for one in dosed for point in product(*one.grids)]
    answers = work.answers(state, [d for one, point in points for d in _directions(one, point)], size)
    places = slices(len(one.term.amplitudes) for one, _ in points)
    by_point = {(one.name, point): place for (one, point), place in zip(points, places, strict=True)}
    columns, refused = {}, {}
    for one in dosed:
        parts = [by_point[(one.name, point)] for point in product(*one.grids)]
        if not all(answers.seen[part].all() for part in parts):
            refused[one.name] = "the outputs do not answer to it"
        elif max(float(answers.curved[part].max()) for part in parts) > CURVED_MOST:
            refused[one.name] = "the answers to two small doses of it do not agree"
        else:
            columns[one.name] = np.stack([answers.columns[:, part] for part in parts])
    off = {departing(one): _off(columns[one.name]) for one in dosed if one.term.form in OFF and one.name in columns}
    laid_out = [_law(one, columns[one.name], size, off) for one in dosed if one.name in columns]
    for one in found:
        if one.tried:
            law = _in_place(work, state, one, size)
            if law is None:
                refused[one.name] = "the outputs do not answer to it, or the simulation runs away"
            else:
                laid_out.append(law)
    return laid_out, refused


OFF = frozenset({TermForm.CONSTANT, TermForm.LINEAR, TermForm.CURVE, TermForm.SLIP, TermForm.MEMORY})
"""Forms by which real objects depart from a form: smooth curves over its port's signals, constant and linear parts
included, lags, and stick-slip. A spring has a little hysteresis, a capacitor a little memory."""


def departing(one: Candidate) -> tuple[str, TermForm, tuple[str, ...]]:
    """Return port, form and signals of terms that can represent departures."""
    return one.term.port, one.term.form, one.term.signals


def departures(work: SimulationRuns, state: FittedState, found: Sequence[Candidate], size: float) -> Departures:
    """Return the slack that other terms give at a state; terms without effect are omitted."""
    points = [(one, point) for one in found for point in product(*(grid[::EVERY] for grid in one.grids))]
    answers = work.answers(state, [d for one, point in points for d in _directions(one, point)], size)
    own = slices(len(one.term.amplitudes) for one, _ in points)
    seen = ((one, place) for (one, _), place in zip(points, own, strict=True) if answers.seen[place].all())
    off = grouped((departing(one), answers.columns[:, place]) for one, place in seen)
    return {key: of_unit_size(parts) for key, parts in off.items()}


def of_unit_size(parts: Sequence[Floats]) -> Floats:
    """Return columns of one form, shape (n, p) each, scaled to rms one."""
    columns = np.hstack(parts)
    rms = np.maximum(np.sqrt(np.mean(np.square(columns), axis=0)), 1e-300)
    return columns / (rms * np.sqrt(len(parts)))


EVERY = 2
"""Every second grid point is used for departures, because responses hardly differ in between."""


def _off(columns: Floats) -> Floats:
    return of_unit_size(list(columns[::EVERY]))


def form_uncertainty(one: Candidate) -> float:
    """Return real objects' relative departure from a form."""
    if one.term.form in {TermForm.CONSTANT, TermForm.OWN}:
        return 0.0
    return LOOSE_FORM_UNCERTAINTY if one.term.form in LOOSE else FORM_UNCERTAINTY


def discrepancy(one: Candidate, off: Departures) -> Discrepancy | None:
    """Return a form's slack: curves, lags and stick-slip over its port, scaled to the effect's size."""
    own = [
        columns
        for key, columns in off.items()
        if key[0] == one.term.port and (one.term.form not in OFF or key != departing(one))
    ]
    if not own or not form_uncertainty(one):
        return None
    columns = np.hstack(own)

    def beside(effect: Floats, _nonlinear: tuple[float, ...], _amplitudes: Floats) -> Floats:
        return columns * rms(effect)

    return beside


def _directions(one: Candidate, point: tuple[float, ...]) -> list[PerturbedParameter]:
    amplitudes = len(one.term.amplitudes)
    term = one.term.with_numbers([0.0] * amplitudes + list(point))
    keys = [(one.name, str(k), *(f"{value:.12g}" for value in point)) for k in range(amplitudes)]
    return [PerturbedParameter(key, 1e-3, k, term) for k, key in enumerate(keys)]


def _law(one: Candidate, columns: Floats, size: float, off: Departures) -> Law:
    rms = np.sqrt(np.mean(np.square(columns), axis=(0, 1)))
    return law_of_term(
        one,
        columns=_between(one.grids, columns),
        plausible=size / np.maximum(rms, 1e-300),
        parameters=one.names,
        units=one.units,
        grids=one.grids,
        positive=one.positive,
        reach=size if one.grids else None,
        discrepancy=discrepancy(one, off),
        driven=frozenset(_at_port(one, one.driven)),
    )


def _in_place(work: SimulationRuns, state: FittedState, one: Candidate, size: float) -> Law | None:
    """Return the law of a replaced signal, with share and size as parameters; None without effect."""
    before = work.residuals([state])[0]
    states = [PerturbedParameter((one.name,), 0.0, 0, one.term).at(state, value) for value in one.tried]
    answers = [before - after for after in work.residuals(states, strict=False)]
    usable = [k for k, answer in enumerate(answers) if answer.any() and np.abs(answer).max() < MOST_ANSWER * size]
    if len(usable) < FEWEST_SIZES:
        return None
    grid = tuple(one.tried[k] for k in usable)
    columns = np.stack([answers[k][:, None] for k in usable])
    return law_of_term(
        one,
        columns=_between((grid,), columns),
        plausible=np.ones(1),
        parameters=(SHARE, one.names[0]),
        units=("", one.units[0]),
        grids=(grid,),
        positive=(True,),
        driven=frozenset(_at_port(one, one.driven)),
    )


def law_of_term(one: Candidate, **further: Any) -> Law:  # noqa: ANN401 - fields of `Law`
    """Return a candidate's law, which follows its signals, else its port."""
    turns = one.term.form in {TermForm.SLIP, TermForm.PLAY}
    return Law(
        name=one.name,
        log_odds=one.log_odds,
        form_uncertainty=form_uncertainty(one),
        followed=tuple(_at_port(one, one.term.signals)) or (f"port {one.term.port}",),
        way="direction" if turns else "late" if one.term.form in MEMORIES else "",
        **further,
    )


def _at_port(one: Candidate, signals: Iterable[str]) -> dict[str, None]:
    return dict.fromkeys(f"{signal} at {one.term.port}" for signal in signals)


SHARE = "share"
"""Amplitude's name in laws that replace a signal."""

FEWEST_SIZES = 2

MOST_ANSWER = 100.0
"""Largest response to replacing a signal, over the residual; larger ones diverge or would be visible."""


def _between(grids: tuple[tuple[float, ...], ...], columns: Floats) -> Callable[[tuple[float, ...]], Floats]:
    several = [k for k, grid in enumerate(grids) if len(grid) > 1]
    table = columns.reshape(*(len(grids[k]) for k in several), *columns.shape[1:])
    if not several:
        return lambda _point: table
    between = RegularGridInterpolator([grids[k] for k in several], table)

    def at(point: tuple[float, ...]) -> Floats:
        return np.asarray(between([[np.clip(point[k], grids[k][0], grids[k][-1]) for k in several]])[0])

    return at
