"""Unmodelled effects: their curves with uncertainty, and models with them, marked as of unknown cause."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.calibration.reporting.figures import identified_model
from dbbstation.diagnosis.findings import Curve, CurvePoint
from dbbstation.diagnosis.shapes import (
    BALL,
    EVERY,
    LEVER_MM,
    OF_STRUTS,
    PULL,
    READING,
    TABLE,
    TOOL,
    TOWARDS,
    UNITS,
    Follows,
)
from dbbstation.diagnosis.unmodelled import EACH
from dbbstation.errors import CalibrationError, ModelError
from dbbstation.facts.serialise import plain
from dbbstation.inference.forms import LinearSplines, Plane, PlaneStep, Walk
from dbbstation.inference.model_comparison import Member
from dbbstation.inference.triangle import rms, root
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Effect, ErrorSource, Fitted
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.diagnosis.explain import SettledCircles
    from dbbstation.diagnosis.findings import Unexplained
    from dbbstation.diagnosis.shapes import Samples, Shape
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.sources.contract import Motion, Parameter


Number = TypeVar("Number", np.float64, np.int64)

LINE_OUT = "less the straight line that fits it best over the readings: joints and reference length make that"
MEAN_OUT = {
    EVERY: "less its mean over the readings: the reference length makes that",
    READING: "less its mean over the readings: the bar's offset makes that",
    BALL: "less its mean over the readings: a shift of the ball makes that",
}
"""Conventional part that is removed from piecewise linear curves, by moved part."""

SIZES = 2.0 ** np.arange(8)
"""Tried prior sizes of curves over the found size, so large errors are not shrunk towards zero."""

AXES = {
    BALL: "along ({:+.2f}, {:+.2f}, {:+.2f}) in machine axes",
    TOOL: "along ({:+.2f}, {:+.2f}, {:+.2f}) in platform axes",
    TABLE: "shift ({:+.2f}, {:+.2f}, {:+.2f}) with turns ({:+.2f}, {:+.2f}, {:+.2f}) about X, Y, Z, these at "
    f"{LEVER_MM:g} mm from the middle of the balls",
    PULL: "strut lengths change as under a force ({:+.2f}, {:+.2f}, {:+.2f}) and moments ({:+.2f}, {:+.2f}, {:+.2f}), "
    f"these at {LEVER_MM:g} mm from the tool tip",
    TOWARDS: "strut lengths change as under a pull of {:+.2f} that way on the middle of the platform's joints, of "
    f"({{:+.2f}}, {{:+.2f}}, {{:+.2f}}) at {LEVER_MM:g} mm from there along X, Y, Z of the platform, and of {{:+.2f}} down",
}
"""Texts on directions, by moved part."""


def curve_of(channel: CircleChannel, settled: SettledCircles, member: Member) -> Curve:
    """Return an effect's curve, including other effects over the same variable."""
    unmodelled, runs, comparison = settled.unmodelled, settled.unmodelled.runs, settled.comparison
    shape = _largest(settled, member)
    together = [m for m in settled.best.members if m is member or any(_adds(shape, s) for s in unmodelled.of(m))]
    others = [m for m in settled.best.members if m not in together]
    sized = max(
        ([replace(m, scale=size * m.scale) for m in together] for size in SIZES),
        key=lambda some: comparison.log_evidence([*some, *others]),
    )
    found = comparison.estimates([*sized, *others])
    each = [s for m in together for s in unmodelled.of(m)]
    ends = np.cumsum([0, *(len(part) for m in together for part in _parts(unmodelled.of(m), m.variant.columns))])
    own = [k for k, one in enumerate(each) if one is shape or _adds(shape, one)]
    rows = np.concatenate([np.arange(ends[k], ends[k + 1]) for k in own])
    columns = np.concatenate([m.variant.columns for m in together])[rows]
    pieces = [_along(runs, each[k], found.values[ends[k] : ends[k + 1]]) for k in own]
    amplitudes = np.concatenate([piece.amplitudes for piece in pieces])
    at, to_points = _summed(runs, [each[k] for k in own], pieces)
    spread = found.covariance[np.ix_(rows, rows)]
    values, covariance = to_points @ amplitudes, to_points @ spread @ to_points.T
    covariance = covariance + np.eye(len(at)) * _not_followed(settled, together) * np.mean(values**2)
    effect = channel.columns.of(columns) @ amplitudes
    alone = len(own) == 1
    alike = len({each[k].kind for k in own}) == 1
    return Curve(
        follows=shape.follows if alike else replace(shape.follows, kind=""),
        unit=UNITS[shape.variable],
        strut=shape.strut,
        form=shape.form.text(UNITS[shape.variable]) if alone else f"sum of {len(own)}",
        period=shape.period if alone else None,
        direction=pieces[0].direction,
        convention=", ".join(dict.fromkeys(piece.words for piece in pieces if piece.words)),
        readings_um=1e3 * rms(effect),
        unconcealed_um=1e3 * rms(channel.unconcealed(effect)),
        points=tuple(
            CurvePoint(float(x), 1e3 * float(value), 1e3 * root(variance))
            for x, value, variance in zip(at, values, np.diag(covariance), strict=True)
        ),
    )


def _largest(settled: SettledCircles, member: Member) -> Shape:
    shapes = settled.unmodelled.of(member)
    found = settled.comparison.estimates([member, *settled.best.without(member.name)])
    parts = _parts(shapes, found.values[: member.width])
    return max(zip(shapes, parts, strict=True), key=lambda one: float(one[1] @ one[1]))[0]


def _parts(shapes: Sequence[Shape], values: NDArray[Number]) -> list[NDArray[Number]]:
    return np.split(values, len(shapes))


def _adds(one: Shape, other: Shape) -> bool:
    if one.variable not in OF_STRUTS or one.strut is None:
        return False
    return (one.variable, one.strut, one.moves) == (other.variable, other.strut, other.moves)


def _summed(runs: Sequence[Samples], shapes: Sequence[Shape], pieces: Sequence[_Piece]) -> tuple[Floats, Floats]:
    if len(pieces) == 1:
        return pieces[0].at, pieces[0].to_points
    at = max((piece.at for piece in pieces), key=len)
    return at, np.hstack([shape.form.columns(at) @ _convention(runs, shape)[0] for shape in shapes])


def _not_followed(settled: SettledCircles, together: Sequence[Member]) -> float:
    unmodelled, comparison = settled.unmodelled, settled.comparison
    names = {m.name for m in together}
    others = settled.best.without(*names)
    scale = max(m.scale for m in together)
    # Forms picked from many also fit noise, by more than one for each amplitude.
    every = [
        Member(cause, variant, scale)
        for cause in unmodelled.causes
        for variant in cause.variants
        if variant.label != EACH
        and (unmodelled.shapes[cause.name, variant.label][0].tried == 1.0 or cause.name in names)
    ]
    without = comparison.explained(others)
    own = comparison.explained([*together, *others]) - without
    more = comparison.explained([*every, *others]) - without - sum(one.width for one in every) - own
    return max(more, 0.0) / max(own, 1e-300)


@dataclass(frozen=True, eq=False)
class _Piece:
    """An effect along its strongest direction.

    Attributes:
        amplitudes: without the part removed by convention, shape (p,).
        to_points: matrix from amplitudes to points, shape (n, p).
    """

    amplitudes: Floats
    to_points: Floats
    at: Floats
    direction: tuple[float, ...]
    words: str


def _along(runs: Sequence[Samples], shape: Shape, found: Floats) -> _Piece:
    keep, convention = _convention(runs, shape)
    directions = len(found) // shape.form.count
    amplitudes = np.kron(np.eye(directions), keep) @ found
    left, _, right = np.linalg.svd(amplitudes.reshape(directions, -1))
    at, curve, over = _over(runs, shape, right[0])
    way, direction, towards = np.ones(1), (), ""
    if shape.moves in AXES:
        # The direction's greatest component is positive.
        way = left[:, 0] * np.sign(left[np.abs(left[:, 0]).argmax(), 0])
        direction, towards = tuple(way.tolist()), AXES[shape.moves].format(*way)
    words = ", ".join(part for part in (towards, over, convention) if part)
    return _Piece(amplitudes, np.asarray(np.kron(way, curve @ keep), dtype=np.float64), at, direction, words)


def _convention(runs: Sequence[Samples], shape: Shape) -> tuple[Floats, str]:
    count = shape.form.count
    if isinstance(shape.form, Walk):
        return np.eye(count), "counted from its first value"
    if not isinstance(shape.form, LinearSplines) or shape.moves not in MEAN_OUT:
        return np.eye(count), ""
    straight = shape.variable == "strut-length"
    line = _line(np.linspace(-1.0, 1.0, count), _weights(runs, shape), int(straight))
    return np.eye(count) - line, LINE_OUT if straight else MEAN_OUT[shape.moves]


def _over(runs: Sequence[Samples], shape: Shape, line: Floats) -> tuple[Floats, Floats, str]:
    form = shape.form
    if isinstance(form, Plane | PlaneStep):
        flat = form.across if isinstance(form, PlaneStep) else line[: form.coordinates]
        flat = flat / max(float(np.linalg.norm(flat)), 1e-12)
        at = form.points(*_extent(runs, shape, flat))
        towards = np.degrees(np.arctan2(flat[1], flat[0]))
        return at, form.columns(at[:, None] * flat), f"over the line at {towards:.0f} deg to {_AXIS[shape.variable]}"
    at = form.points(*_extent(runs, shape, None))
    words = "negative angles are those of clockwise runs" if shape.variable == "angle since the start" else ""
    return at, form.columns(at), words


_AXIS = {"position of the platform": "+X", "tilt of the platform": "that of tilt A"}


def _line(at: Floats, weights: Floats, order: int) -> Floats:
    """Return the projection on polynomials, shape (p, p)."""
    basis = np.vander(at, order + 1)
    weighted = basis.T * weights
    return basis @ np.linalg.solve(weighted @ basis, weighted)


def _values(shape: Shape, run: Samples) -> Floats:
    return shape.followed(run.values[shape.variable])


def _weights(runs: Sequence[Samples], shape: Shape) -> Floats:
    return sum(shape.form.columns(_values(shape, run)).reshape(-1, shape.form.count).sum(axis=0) for run in runs)


def _extent(runs: Sequence[Samples], shape: Shape, flat: Floats | None) -> tuple[float, float]:
    values = [_values(shape, run) for run in runs]
    along = values if flat is None else [value @ flat for value in values]
    return float(min(one.min() for one in along)), float(max(one.max() for one in along))


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
