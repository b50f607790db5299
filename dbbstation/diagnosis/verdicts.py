"""Findings on named causes of circles, by the rules of generic channels; the three answers; limits and biases."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import is_missing_physics
from dbbstation.calibration.outliers.outlier import OutlierKind
from dbbstation.diagnosis.findings import Shift, SourceFinding
from dbbstation.diagnosis.parts import SESSION_TIME, amplitudes, variable_of
from dbbstation.diagnosis.shapes import SIGNED
from dbbstation.facts import of_facts
from dbbstation.facts.value import Value
from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.bank import Bank
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import Base, Channel, Law, impossibly_negative
from dbbstation.inference.coloured import Coloured
from dbbstation.inference.left_over import SIGNIFICANT, LeftOver, ResidualTest
from dbbstation.inference.levels import (
    BALL,
    BAR,
    JOINED,
    OUT,
    RUN,
    SURE,
    Differs,
    Followed,
    FollowsAnswer,
    LimitReached,
    Verdict,
    ambiguous,
    open_to,
    with_texts,
)
from dbbstation.inference.levels_of import levels_by_tests
from dbbstation.inference.read_off import CauseJudge, Trial, concealed
from dbbstation.inference.settle import Settled
from dbbstation.inference.triangle import root
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.diagnosis.explain import Explained, SettledCircles
    from dbbstation.inference.folds import KnownGains
    from dbbstation.inference.levels import Levels, Said
    from dbbstation.inference.model_comparison import Cause, Member
    from dbbstation.inference.projection import BesideBase


class CircleJudge(CauseJudge):
    """Makes findings on named causes.

    Args:
        gains: of held-out tests; None if not tested.
    """

    is_catalogue = True

    def __init__(self, explained: Explained, outcome: Settled, gains: KnownGains | None, levels: Levels) -> None:
        self._circles, self._joint = explained.channel, explained.settled
        self._named = {cause.name: cause for cause in outcome.causes if cause.named}
        super().__init__(outcome, Trial(gains), levels)

    def findings(self) -> tuple[SourceFinding, ...]:
        """Return one finding per named cause, present ones first."""
        found = [self._source_finding(cause) for cause in self._named.values()]
        return tuple(sorted(found, key=lambda f: (f.verdict.rank, -(f.gain or 0.0))))

    def _source_finding(self, cause: Cause) -> SourceFinding:
        one, member = self.finding(cause), self._members.get(cause.name)
        shown = member or self._beside[cause.name][1]
        texts = self._circles.sources[cause.name, shown.variant.law].texts
        return of_facts(
            SourceFinding,
            one,
            ambiguous_with=self._in_words(one.ambiguous_with),
            gain=one.log_bayes_factor,
            concealed=one.confounded,
            signature_rms_um=1e3 * one.whole_rms,
            unconcealed_rms_um=1e3 * one.rms,
            parameters=one.values,
            text=with_texts(one.verdict, one.text, texts),
            equivalent=tuple(name for name in one.equivalent if name in self._named),
            log_evidence=one.log_bayes_factor,
            sigmas=0.0 if member is None else one.sigmas,
        )

    def _in_words(self, names: Iterable[str]) -> tuple[str, ...]:
        follows = self._joint.unmodelled.follows
        return tuple(f"an unmodelled effect over {follows[n]}" if n in follows else n for n in names)

    def _verdict(self, cause: Cause, member: Member | None, probability: float, sigmas: float) -> Said:
        verdict, others, text = super()._verdict(cause, member, probability, sigmas)
        group = self._group_of(cause.name) if member is None else ()
        if verdict is not Verdict.AMBIGUOUS or (not group and (others or (probability >= SURE and sigmas >= OUT))):
            return verdict, others, text
        others = tuple(n for n in group if n != cause.name) or self._alternatives.ambiguity(cause.name)
        if not others and len(self._equal(cause.name)) == 1:
            return open_to(self._rows)
        return ambiguous(self._rows, self._in_words(others), text)

    def _group_of(self, name: str) -> tuple[str, ...]:
        groups = [(*one.form.names, *one.form.not_worse) for one in self._levels.follows if one.form is not None]
        groups += [equal for equal in self._classes.values() if len(equal) > 1]
        groups += [(own, *others) for own, others in self._alternatives.ambiguities.items()]
        return next((tuple(n for n in group if JOINED not in n) for group in groups if name in group), ())

    def _instead_of(self, name: str) -> frozenset[str]:
        del name
        return frozenset()

    def _concealed(self, shown: Member, effect: Floats, values: Floats) -> tuple[float, float, float]:
        """Return an effect's found or plausible rms, the rms not absorbed [mm], and the absorbed share."""
        columns = shown.variant.columns
        amplitudes = values[: len(columns)] if shown.name in self._members else shown.variant.plausible
        effect = self._circles.columns.of(columns) @ amplitudes
        return concealed(effect, self._circles.unconcealed(effect))

    def _absent(self, cause: Cause, probability: float) -> Said:
        unseen_at = self._unseen_points(cause)
        others = self._best.without(cause.name)
        if unseen_at and self._would_show(cause.widest, others):
            source = self._circles.source_of(cause.name, cause.variants[0])
            listed = next(p for p in source.parameters(self._circles.machine) if p.listed)
            at = ", ".join(f"{value:g}" for value in unseen_at)
            where = f"where {listed.name} is {at}: the scatter of balls and the fitted parameters conceal it."
            return Verdict.NOT_TESTABLE, (), f"These tests would not show it {where}"
        return super()._absent(cause, probability)

    def _unseen_points(self, cause: Cause) -> list[float]:
        """Return values of a listed parameter, such as a bump's run, for which these tests do not show a cause."""
        # Each listed value is a separate case.
        found = set()
        for variant in cause.variants:
            if variant.label or not variant.nonlinear:
                continue
            source = self._circles.source_of(cause.name, variant)
            listed = [p.listed for p in source.parameters(self._circles.machine) if p.grid]
            if any(listed) and not self._would_show(variant, self._best.without(cause.name)):
                found.add(variant.nonlinear[listed.index(True)])
        return sorted(found)

    def _values_of(self, member: Member, values: Floats, covariance: Floats) -> dict[str, Value]:
        """Return the finding's `parameters`."""
        if member.name in self._members:
            return self._fitted(member.name)
        source = self._circles.source_of(member.name, member.variant)
        own, spread = member.width, self._circles.to_whole(member.variant)
        whole, variance = spread @ values[:own], np.diag(spread @ covariance[:own, :own] @ spread.T)
        return {
            p.name: Value(float(whole[k]), root(variance[k]), p.unit)
            for k, p in enumerate(amplitudes(source, self._circles.machine))
        }

    def _impossible(self, shown: Member, values: Floats, covariance: Floats) -> str:
        source = self._circles.source_of(shown.name, shown.variant)
        found = self._values_of(shown, values, covariance)
        positive = {p.name: found[p.name] for p in source.parameters(self._circles.machine) if p.positive}
        sigma = {n: float(np.hypot(v.uncertainty, source.form_uncertainty * v.value)) for n, v in positive.items()}
        each = (impossibly_negative(n, v.value, sigma[n], v.unit) for n, v in positive.items())
        return next(filter(None, each), "")

    def _fitted(self, name: str) -> dict[str, Value]:
        after = self._joint.after
        variance = uncertainties(after, unseen(after)) ** 2 + after.layout.formula_variance(after.x)
        found = after.x.copy()
        own, shift, beside = self._beside_nameless(name)
        found[own] += shift
        variance[own] = np.maximum(variance[own], beside)
        values: dict[str, Value] = {}
        for term in after.layout.terms:
            if term.source.name != name:
                continue
            for k, parameter in enumerate(term.parameters):
                column = term.columns.start + k
                key = parameter.name if not values.get(parameter.name) else f"{parameter.name} ({term.shared})"
                values[key] = Value(float(found[column]), float(np.sqrt(variance[column])), parameter.unit)
        return values

    def _beside_nameless(self, name: str) -> tuple[Integers, Floats, Floats]:
        amplitudes = self._joint.after.layout.columns_of(name)[0]
        if self._best.members == self._joint.members:
            return amplitudes[:0], np.zeros(0), np.zeros(0)
        first = sum(len(m.columns) for m in self._joint.members[: [m.name for m in self._joint.members].index(name)])
        width, spread = self._members[name].width, self._circles.to_whole(self._members[name].variant)
        alone = self._settled.comparison.estimates(self._joint.members).values[first : first + width]
        values, covariance = self._values[name]
        variances = np.diag(spread @ covariance[:width, :width] @ spread.T)
        return amplitudes, spread @ (values[:width] - alone), variances


class CircleBank(Bank):
    """A bank of columns that circles already have, in white noise."""

    def __init__(self, rows: Channel, circles: CircleChannel, settled: SettledCircles) -> None:
        self.channel, self.patterns, self.laws = rows, {}, {law.name: law for law in rows.laws}
        self.noise, self.whitening, self.tails = Coloured(settled.noise_mm), None, np.inf
        self._columns, self._circles, self._scatter = circles.columns, circles, settled.scatter
        self.nameless = frozenset(cause.name for cause in settled.causes if not cause.named)

    def samples(self, columns: Integers) -> Floats:
        """Return columns over all rows, shape (n, p) [mm]."""
        return self._columns.of(columns)

    def beside(self, but_for: Flags | None = None, only: Integers | None = None) -> BesideBase:
        """Return causes with the base projected out."""
        return self._circles.beside_base(self.noise.sigma, self._scatter, but_for, only)


def outcome_of(explained: Explained) -> Settled:
    """Return the circles' results as a generic outcome [mm]."""
    circles, settled = explained.channel, explained.settled
    base = circles.base
    rows = Channel(
        residual=settled.target,
        unit="mm",
        blocks=tuple(circles.runs),
        names=tuple(f"{o.test} {o.raw.circle.direction}" for o in circles.observations),
        variables=(),
        base=Base(("the kinematic parameters",), circles.columns.base, base.prior, base.random),
        laws=tuple(_law(explained, cause) for cause in settled.causes),
        interchangeable=EQUIVALENT**2,
        rows_are="tests",
    )
    bank = CircleBank(rows, circles, settled)
    return Settled(
        channel=rows,
        bank=bank,
        noise=bank.noise,
        causes=settled.causes,
        comparison=settled.comparison,
        posterior=settled.posterior,
        stopped=settled.stopped,
    )


def _law(explained: Explained, cause: Cause) -> Law:
    settled, circles, variant = explained.settled, explained.channel, cause.variants[0]
    member = next((m for m in settled.best.members if m.name == cause.name), None)
    variant = variant if member is None else member.variant
    source = circles.sources.get((cause.name, variant.law))
    follows = settled.unmodelled.follows.get(cause.name)
    once = cause.setup or (source is not None and circles.happens_once(cause.name))
    if cause.setup:
        variable = BAR if cause.name == "bar-offset" else BALL
    elif follows is not None:
        variable = SESSION_TIME if follows.variable == "time" and follows.kind != "wander" else follows.variable
    else:
        variable = RUN if once or source is None else variable_of(source)
    signed = variable.endswith("sign") or (follows is not None and follows.moves == SIGNED)

    def columns(point: tuple[float, ...]) -> Floats:
        return circles.columns.of(next(one.columns for one in cause.variants if one.nonlinear == point))

    return Law(
        cause.name,
        columns,
        variant.plausible,
        (),
        (),
        form_uncertainty=variant.form_uncertainty,
        log_odds=cause.log_prior_odds,
        followed=(variable,),
        way="direction" if signed else "",
        acts_once=once,
        confirm="" if source is None else source.texts.confirm,
    )


def circle_levels(explained: Explained, outcome: Settled, gains: KnownGains | None) -> Levels:
    """Return the three answers for circles [µm]."""
    found = levels_by_tests(outcome, _left(explained), gains).times(1e3)
    unmodelled = explained.settled.unmodelled.follows
    # An effect on no strut has no strut as place, even with all amplitudes.
    nowhere = {name for name, follows in unmodelled.items() if not follows.moves_struts}
    follows = (replace(one, where=None) if nowhere.intersection(one.members) else one for one in found.follows)
    found = replace(found, follows=tuple(follows))
    if not explained.outliers:
        return found
    differs = replace(found.differs, answer=Differs.YES, why="", probability=1.0)
    return replace(found, differs=differs, follows=(*found.follows, *map(_happened, explained.outliers)))


def _happened(outlier: Outlier) -> Followed:
    """Return a ball, bar or run excluded from the fit as a class, in µm."""
    variable = {OutlierKind.RUN: RUN, OutlierKind.BAR: BAR}.get(outlier.kind, BALL)
    return Followed(
        ((variable,),), (), FollowsAnswer.HAPPENED, 1.0, {}, outlier.size_um, (), where=outlier.runs or outlier.test
    )


def _left(explained: Explained) -> LeftOver:
    settled = explained.settled
    if any(settled.unmodelled.of(member) for member in settled.best.members):
        return LeftOver(True, 1.0, ())  # noqa: FBT003 - its first field
    found, (rms_um, where) = settled.remainder, where_left(settled)
    is_noise = not is_missing_physics(settled.left) and found.probability >= SIGNIFICANT
    test = ResidualTest("these tests", found.probability, rms_um / 1e3, where)
    return LeftOver(is_noise, found.probability, (test,))


def where_left(settled: SettledCircles) -> tuple[float, str]:
    """Return size [µm] and place, as a sentence, of the largest residual."""
    observations, found = settled.after.observations, settled.remainder
    worst = min((found.harmonic, found.run, found.pulse), key=lambda one: one.probability)
    size_um = 1e3 * worst.rms
    if worst is found.harmonic:
        return size_um, f"Most of it comes {worst.place} times per turn, {size_um:.2g} µm rms over all runs."
    run = f"test {observations[worst.place].test} {observations[worst.place].raw.circle.direction}"
    if worst is found.run:
        return size_um, f"Most of it is in {run}, {size_um:.2g} µm rms."
    return size_um, f"Most of it is in {run} about {np.degrees(found.pulse_phase_rad):.0f} degrees, {size_um:.2g} µm."


def limits_of(settled: SettledCircles) -> tuple[LimitReached, ...]:
    """Return all limits, the search first."""
    found = []
    if settled.stopped:
        found.append(
            LimitReached("stopped", "", "Somebody stopped the comparison. This is the best that it had found.")
        )
    if settled.posterior.at_limit:
        _, where = where_left(settled)
        text = (
            f"The search ended at sets of {BOUNDS.members} causes, and a larger set is more probable. What is named stays. "
            f"The named causes leave {1e3 * settled.left.rms:.2g} µm rms beyond noise. {where}"
        )
        found.append(LimitReached("search", "", text))
    return (*found, *limits_of_fit(settled.after))


def limits_of_fit(fit: Calibration) -> tuple[LimitReached, ...]:
    """Return parameters at limits, and a last step without convergence."""
    found = [_at_end(fit, column) for column in fit.at_limit]
    if not fit.settled:
        text = "The joint fit still moved at its last step. Values and uncertainties are those of that step."
        found.append(LimitReached("fit", "", text))
    return tuple(found)


def _at_end(fit: Calibration, column: int) -> LimitReached:
    term = next(one for one in fit.layout.terms if one.columns.start <= column < one.columns.stop)
    parameter = term.parameters[column - term.columns.start]
    value = float(fit.x[column])
    end = "lower" if value <= float(np.mean(parameter.limits)) else "upper"
    text = (
        f"{term.source.name}: {parameter.name} is at the {end} end of its range, {value:.4g} {parameter.unit}. "
        "The true value may lie beyond it."
    )
    return LimitReached("parameter", f"{term.source.name} {parameter.name}", text)


def uncertainties(calibration: Calibration, held: Floats) -> Floats:
    """Return every column's standard uncertainty, shape (k,), including `held_variance`."""
    seen = np.maximum(calibration.solution.variance, 0.0)
    return np.sqrt(seen + held_variance(calibration, held))


def held_variance(calibration: Calibration, held: Floats) -> Floats:
    """Return every column's variance along held directions, shape (k,)."""
    # A source may have its found or plausible size there, whichever is greater. For example, a ball displaced by 70 µm
    # in determined directions may be displaced by 20 µm in others.
    known = calibration.layout.known
    fitted = np.flatnonzero(~known.random)
    amplitudes = calibration.x[fitted] / known.scale[fitted]
    hidden = np.sum(calibration.solution.held**2, axis=0)
    square = np.ones(len(known.random))
    for name, least in {term.source.name: term.source.concealed_times**2 for term in calibration.layout.terms}.items():
        columns, _ = calibration.layout.columns_of(name)
        own = np.isin(fitted, columns)
        seen = float(np.sum(1.0 - hidden[own]))
        found = float(np.sum(amplitudes[own] ** 2)) / seen if seen > HALF else 0.0
        square[columns] = max(least, found)
    along = held**2 @ square[fitted]
    variance = np.zeros(len(known.random))
    variance[fitted] = along @ (held * known.scale[fitted]) ** 2
    return variance


def unseen(calibration: Calibration) -> Floats:
    """Return undetermined directions as orthonormal rows for the model file, shape (h, f)."""
    fitted = np.flatnonzero(~calibration.layout.known.random)
    return calibration.null_space[:, fitted] / calibration.layout.known.scale[fitted]


def held_beside(before: Calibration, after: Calibration) -> Floats:
    """Return directions that only the joint fit holds, shape (h, f); the base's directions are conventions."""
    wide = np.zeros((len(before.solution.held), after.solution.held.shape[1]))
    wide[:, : before.solution.held.shape[1]] = before.solution.held
    beyond = after.solution.held - (after.solution.held @ wide.T) @ wide
    _, size, rows = np.linalg.svd(beyond, full_matrices=False)
    return rows[size > HALF]


HALF = float(np.sqrt(0.5))
"""Least length of a separate direction after projecting out the base's directions, and least determined share of a
source's amplitudes that gives the size of the others."""


def shifts_between(before: Calibration, after: Calibration) -> tuple[Shift, ...]:
    """Return biases of machine parameters, largest first; may be empty."""
    if after is before:
        return ()
    row_of = {name: k for k, name in enumerate(after.layout.names)}
    sigma = uncertainties(after, held_beside(before, after))
    shifts = []
    for term in before.layout.terms:
        if term.source.belongs_to is not Owner.MACHINE:
            continue
        for k, parameter in enumerate(term.parameters):
            row = row_of[term.source.name, term.shared, parameter.name]
            old, new = 1e3 * float(before.x[term.columns.start + k]), 1e3 * float(after.x[row])
            name = f"{term.source.name} {parameter.name.removesuffix('_mm')}"
            shifts.append(Shift(name, old, new, old - new, 1e3 * float(sigma[row])))
    return tuple(sorted(shifts, key=lambda shift: -abs(shift.shift_um)))
