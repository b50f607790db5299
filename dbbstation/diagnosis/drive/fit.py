"""Mass, viscous friction and chosen causes fitted together, numbers that the force is not proportional to included."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from dbbstation.diagnosis.drive.design import BASE
from dbbstation.diagnosis.findings import Value
from dbbstation.inference.jackknife import jackknife_covariance
from dbbstation.inference.square_root import compress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.contract import Form
    from dbbstation.diagnosis.drive.design import Design
    from dbbstation.inference.race import Candidate, Variant

ROUNDS = 2
"""Times that every shape is searched anew beside the others."""

METHOD_SHARE = 5e-4
"""Standard uncertainty, of a value, that low-pass, differences and the moment of a reversal leave of a perfect recording;
on simulated drives they make the mass too small by half of this."""

DIFFERENCE = 1e-4
"""Relative step of a shape for its derivative."""


@dataclass(frozen=True, eq=False)
class Term:
    """A cause in the model.

    Attributes:
        name: of the cause.
        form: chosen.
        value: of the form's shape.
    """

    name: str
    form: Form
    value: float


def term_of(design: Design, candidate: Candidate, variant: Variant) -> Term:
    """Term of a candidate in one of its variants, whose shape says which form it is."""
    form = design.forms[candidate.name][int(variant.shape[0])]
    return Term(candidate.name, form, form.value)


@dataclass(frozen=True, eq=False)
class DriveFit:
    """A fitted model.

    Attributes:
        terms: causes, in order.
        columns: base, amplitudes of all terms, then one column per shape, shape (m, k).
        values: of the columns; zero for shapes, about which the columns are taken, shape (k,).
        covariance: shape (k, k).
        force_n: of the model at all samples, shape (m,) [N].
        square: sum of squares that is left of the fitted samples [N²].
    """

    terms: tuple[Term, ...]
    columns: NDArray[np.float64]
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    force_n: NDArray[np.float64]
    square: float

    def amplitudes(self, name: str) -> slice:
        """Columns of one cause's amplitudes."""
        start = len(BASE)
        for term in self.terms:
            stop = start + len(term.form.amplitudes)
            if term.name == name:
                return slice(start, stop)
            start = stop
        raise KeyError(name)

    def parameters(self, name: str) -> dict[str, Value]:
        """Amplitudes and shape of one cause with their uncertainties."""
        term = next(term for term in self.terms if term.name == name)
        sigma = np.sqrt(np.diag(self.covariance))
        rows = self.amplitudes(name)
        found = {
            p.name: Value(float(self.values[k]), float(sigma[k]), p.unit)
            for p, k in zip(term.form.amplitudes, range(rows.start, rows.stop), strict=True)
        }
        if term.form.shape is not None:
            shaped = [one.name for one in _shaped(self)]
            column = self.columns.shape[1] - len(shaped) + shaped.index(name)
            # The column is the derivative by the logarithm of the shape.
            found[term.form.shape.name] = Value(term.value, term.value * float(sigma[column]), term.form.shape.unit)
        return found

    def all_values(self) -> dict[str, float]:
        """Values of all parameters of the model by name, base included."""
        found = {name: value.value for name, value in base_values(self).items()}
        for term in self.terms:
            found |= {name: value.value for name, value in self.parameters(term.name).items()}
        return found


def fit(design: Design, terms: Sequence[Term], rows: NDArray[np.bool_] | None = None) -> DriveFit:
    """Fit base and causes together.

    The standard uncertainty of every value is the larger of two: from the samples' noise as smooth things feel it, and
    from how the value moves when stretches of the recording are left out in turn.

    Args:
        design: the recording.
        terms: causes with the values at which the search for their shapes begins.
        rows: samples to fit, shape (m,); all if None.
    """
    rows = np.ones(len(design.force_n), dtype=bool) if rows is None else rows
    terms = _searched(design, list(terms), rows)
    amplitudes = _columns(design, terms)
    found, *_ = np.linalg.lstsq(amplitudes[rows], design.force_n[rows], rcond=None)
    values = np.asarray(found, dtype=np.float64)
    derivatives = _by_shapes(design, terms, values[len(BASE) :])
    columns = np.hstack([amplitudes, derivatives])
    covariance = _covariance(design, columns, rows)
    left = design.force_n[rows] - amplitudes[rows] @ values
    return DriveFit(
        terms=tuple(terms),
        columns=columns,
        values=np.concatenate([values, np.zeros(derivatives.shape[1])]),
        covariance=covariance,
        force_n=amplitudes @ values,
        square=float(left @ left),
    )


def _columns(design: Design, terms: Sequence[Term]) -> NDArray[np.float64]:
    """Base and amplitudes, shape (m, b + p)."""
    return np.hstack([design.columns[:, : len(BASE)], *(_of_term(design, term) for term in terms)])


def _of_term(design: Design, term: Term) -> NDArray[np.float64]:
    return design.signals.compared(term.form.columns(design.signals, term.value))


def _searched(design: Design, terms: list[Term], rows: NDArray[np.bool_]) -> list[Term]:
    """Terms with their shapes where they fit best, one after another beside the others."""
    shaped = [k for k, term in enumerate(terms) if term.form.shape is not None]
    begun = [term.value for term in terms]
    force = design.force_n[rows]
    for _ in range(ROUNDS if len(shaped) > 1 else 1):
        for k in shaped:
            others = _columns(design, terms[:k] + terms[k + 1 :])[rows]
            q, _ = np.linalg.qr(others)
            rest = force - q @ (q.T @ force)

            def left(log: float, k: int = k, q: NDArray[np.float64] = q, rest: NDArray[np.float64] = rest) -> float:
                own = _of_term(design, replace(terms[k], value=float(np.exp(log))))[rows]
                own = own - q @ (q.T @ own)
                found, *_ = np.linalg.lstsq(own, rest, rcond=None)
                return float(np.sum((rest - own @ found) ** 2))

            reach = np.log(terms[k].form.reach)
            middle = np.log(begun[k])
            best = minimize_scalar(left, bounds=(middle - reach, middle + reach), method="bounded")
            terms[k] = replace(terms[k], value=float(np.exp(best.x)))
    return terms


def _by_shapes(design: Design, terms: Sequence[Term], amplitudes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of the force by the logarithm of every shape, shape (m, s)."""
    found = [np.zeros((len(design.force_n), 0))]
    start = 0
    for term in terms:
        own = amplitudes[start : start + len(term.form.amplitudes)]
        start += len(own)
        if term.form.shape is not None:
            up, down = (
                _of_term(design, replace(term, value=term.value * np.exp(step))) for step in (DIFFERENCE, -DIFFERENCE)
            )
            found.append(((up - down) @ own / (2.0 * DIFFERENCE))[:, None])
    return np.hstack(found)


def _covariance(design: Design, columns: NDArray[np.float64], rows: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Covariance by the blocks, none of its variances smaller than the noise alone would have it."""
    norm = np.maximum(np.linalg.norm(columns[rows], axis=0), 1e-300)
    _, s, vt = np.linalg.svd(columns[rows] / norm, full_matrices=False)
    with np.errstate(over="ignore"):  # of a column of zeros nothing is known
        by_noise = design.noise_n**2 * np.sum((vt.T / np.maximum(s, 1e-12 * s[0])) ** 2, axis=1) / norm**2
    numbers = np.arange(columns.shape[1])
    groups = design.groups
    blocks = [
        compress(numbers, columns[inside], design.force_n[inside])
        for inside in (rows & (groups == group) for group in range(int(groups[-1]) + 1))
        if inside.any()
    ]
    by_blocks = jackknife_covariance(blocks, columns.shape[1])
    wider = np.sqrt(np.maximum(by_noise / np.maximum(np.diag(by_blocks), 1e-300), 1.0))
    return np.asarray(by_blocks * np.outer(wider, wider))


def with_method(fitted: DriveFit, other: DriveFit | None) -> DriveFit:
    """The same fit with what filters, differences and the choice of the band do to its values in their uncertainty.

    Args:
        fitted: the model.
        other: the same model fitted in another band, None where there is none; a value may lie anywhere between the
            two, and as far on the other side.
    """
    moved, unsure = np.zeros_like(fitted.values), np.zeros_like(fitted.values)
    if other is not None:
        unsure = np.diag(other.covariance)
        moved = other.values - fitted.values
        shaped = _shaped(fitted)
        for k, (one, two) in enumerate(zip(shaped, _shaped(other), strict=True), start=len(moved) - len(shaped)):
            moved[k] = np.log(two.value / one.value)
    # A value that the other band hardly sees moves by chance there, which is no fault of this one.
    more = np.maximum(moved**2 - unsure, 0.0) / 3.0 + (METHOD_SHARE * fitted.values) ** 2
    wider = np.sqrt(1.0 + more / np.maximum(np.diag(fitted.covariance), 1e-300))
    return replace(fitted, covariance=fitted.covariance * np.outer(wider, wider))


def _shaped(fitted: DriveFit) -> list[Term]:
    return [term for term in fitted.terms if term.form.shape is not None]


def base_values(fitted: DriveFit) -> dict[str, Value]:
    """Base parameters by name."""
    sigma = np.sqrt(np.diag(fitted.covariance))
    return {name: Value(float(fitted.values[k]), float(sigma[k]), BASE_UNITS[k]) for k, name in enumerate(BASE)}


BASE_UNITS = ("kg", "N·s/m")
