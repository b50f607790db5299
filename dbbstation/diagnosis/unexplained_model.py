"""Models that include an unmodelled effect, marked as of unknown cause."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.calibration.reporting.figures import identified_model
from dbbstation.diagnosis.findings import CurvePoint
from dbbstation.diagnosis.shapes import Follows
from dbbstation.errors import CalibrationError, ModelError
from dbbstation.facts.serialise import plain
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Effect, ErrorSource, Fitted
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.findings import Curve, Unexplained
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.sources.contract import Motion, Parameter

KEPT_AS = {
    Follows("strut-length"): "unexplained-by-length",
    Follows("strut-length", "wave"): "unexplained-wave",
    Follows("strut-force"): "unexplained-by-force",
}
"""Sources that represent an unmodelled error in a model, by its variable, which every program determines."""


@dataclass(frozen=True, eq=False)
class JointFitWithCurve:
    """A joint fit of named causes and the unmodelled curve.

    Attributes:
        to_all: matrix from fitted to all parameters, shape (p, f).
    """

    source: ErrorSource
    fit: Calibration
    to_all: Floats
    curve: Curve

    def identified(self, report: Mapping[str, Any], sessions: Mapping[str, str]) -> IdentifiedModel:
        """Return the model to store; unfitted parameters are zero."""
        found = identified_model(self.fit, {**report, "unexplained": plain(self.curve)}, sessions)
        machine, name = found.model.machine, self.source.name
        names = [parameter.name for parameter in self.source.parameters(machine)]
        sources = tuple(
            Fitted(self.source, self.to_all @ one.values) if one.source.name == name else one
            for one in found.model.sources
        )
        others = [k for k, (source, _, _) in enumerate(found.covariance_rows) if source != name]
        own = [k for k, (source, _, _) in enumerate(found.covariance_rows) if source == name]
        used = np.flatnonzero(self.to_all.any(axis=1))
        spread = np.zeros((len(others) + len(used), len(found.covariance_rows)))
        spread[np.arange(len(others)), others] = 1.0
        spread[np.ix_(len(others) + np.arange(len(used)), np.array(own))] = self.to_all[used]
        covariance = spread @ found.covariance @ spread.T
        return replace(
            found,
            model=replace(found.model, sources=sources),
            covariance_rows=(*(found.covariance_rows[k] for k in others), *((name, "", names[k]) for k in used)),
            covariance=(covariance + covariance.T) / 2.0,
            null_space=None if found.null_space is None else found.null_space @ spread.T,
            formula_variance=None if found.formula_variance is None else spread**2 @ found.formula_variance,
        )


def keep_unexplained(curve: Curve | None, after: Calibration) -> JointFitWithCurve:
    """Fit named causes and the unmodelled curve jointly.

    Raises:
        ModelError: no unmodelled effect remains, or it does not depend on the pose.
        CalibrationError: the fit does not converge.
    """
    if curve is None:
        raise ModelError("the model has no unnamed effect that a curve describes")
    if curve.follows not in KEPT_AS:
        raise ModelError(
            f"the residual cannot be compensated: it follows {curve.variable}, and programs or error sources lack this variable"
        )
    (source,) = sources_named([KEPT_AS[curve.follows]])
    machine = after.layout.machine
    to_all = _to_all(len(source.parameters(machine)) // STRUTS, curve.strut)
    part = _part(source, to_all, curve.strut)
    terms = after.layout.terms
    sources = {term.source.name: term.source for term in terms}.values()
    begin = {t.source.name: after.x[t.columns] for t in terms if any(parameter.grid for parameter in t.parameters)}
    if curve.period_mm is not None:
        begin[source.name] = _wave(curve, machine)
    fit = calibrate(machine, after.observations, [*sources, part], begin)
    return JointFitWithCurve(source, fit, to_all, curve)


def with_exact_wave(rest: Unexplained, after: Calibration) -> Unexplained:
    """Return the finding with its wave fitted exactly."""
    # Joints absorb part of a long wave, which biases the search by some per cent. Without convergence the finding is
    # unchanged.
    curve = rest.curve
    if curve is None or curve.period_mm is None or curve.strut is None:
        return rest
    try:
        kept = keep_unexplained(curve, after)
    except CalibrationError:
        return rest
    columns = next(term.columns for term in kept.fit.layout.terms if term.source.name == kept.source.name)
    sine, cosine, period = kept.fit.x[columns]
    at = np.array([point.at for point in curve.points])
    angle = 2.0 * np.pi * (at - sum(after.layout.machine.travel.strut_mm) / 2.0) / period
    by_period = -(sine * np.cos(angle) - cosine * np.sin(angle)) * angle / period
    by = np.column_stack([np.sin(angle), np.cos(angle), by_period])
    values = by[:, :2] @ (sine, cosine)
    sigma = np.sqrt(np.einsum("ni,ij,nj->n", by, kept.fit.solution.covariance[columns, columns], by))
    points = tuple(CurvePoint(*map(float, point)) for point in zip(at, values, sigma, strict=True))
    return replace(rest, curve=replace(curve, form=f"period {period:.6g} mm", period=float(period), points=points))


def _to_all(each: int, strut: int | None) -> Floats:
    """Return the matrix from one strut's parameters, or shared ones, to all struts' parameters, shape (6 each, each)."""
    chosen = np.ones(STRUTS) if strut is None else np.eye(STRUTS)[strut - 1]
    return np.kron(chosen[:, None], np.eye(each))


def _part(whole: ErrorSource, to_all: Floats, strut: int | None) -> ErrorSource:
    first = int(np.flatnonzero(to_all.any(axis=1))[0])

    class TiedSource(ErrorSource):
        """A source with tied parameters."""

        name = whole.name
        belongs_to = whole.belongs_to
        needs = whole.needs
        varies_with = whole.varies_with
        candidate = False
        form_uncertainty = whole.form_uncertainty
        texts = whole.texts

        def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
            """Return the first strut's parameters."""
            own = whole.parameters(machine)[first : first + to_all.shape[1]]
            return own if strut else tuple(replace(p, name=p.name.replace("strut_1", "every_strut")) for p in own)

        def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
            """Return the effect of all parts with these values."""
            return whole.effect(motion, machine, to_all @ values)

        def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
            """Return the derivative of this effect."""
            return whole.derivative(motion, machine, to_all @ values).times(to_all)

    return TiedSource()


def _wave(curve: Curve, machine: Machine) -> Floats:
    """Return a wave's sine and cosine [µm] and period [mm], from points."""
    assert curve.period_mm is not None  # noqa: S101 - asked by the caller
    at = np.array([point.at for point in curve.points]) - sum(machine.travel.strut_mm) / 2.0
    angle = 2.0 * np.pi * at / curve.period_mm
    sides = np.array([point.value_um for point in curve.points])
    (sine, cosine), *_ = np.linalg.lstsq(np.column_stack([np.sin(angle), np.cos(angle)]), sides, rcond=None)
    return np.array([sine, cosine, curve.period_mm])
