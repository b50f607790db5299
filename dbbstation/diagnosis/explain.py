"""Find the sets of causes that explain the recordings, relinearised about the best."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from dbbstation.calibration.checks.scatter import misfit_of, remainder_of, seats_of
from dbbstation.calibration.fit.calibrate import Calibration, calibrate, default_sources
from dbbstation.calibration.outliers.robust import MOST, calibrate_robust, in_place_after_all
from dbbstation.calibration.outliers.stray_balls import set_free
from dbbstation.diagnosis.channel import CircleChannel
from dbbstation.diagnosis.parts import at_point
from dbbstation.diagnosis.unmodelled import EACH, Unmodelled
from dbbstation.errors import CalibrationError, KinematicsError
from dbbstation.inference.alternatives import in_place_of, named_already
from dbbstation.inference.bounds import BOUNDS, CIRCLES
from dbbstation.inference.hypotheses import Hypothesis, other_laws, search
from dbbstation.inference.levels import SURE
from dbbstation.inference.model_comparison import SCALES, all_columns
from dbbstation.inference.settle import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from dbbstation.calibration.outliers.outlier import Fit, Outlier
    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.harmonics import Misfit, Spectrum
    from dbbstation.inference.hypotheses import Posterior
    from dbbstation.inference.left_over import Remainder
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison
    from dbbstation.inference.projection import BesideBase
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource


@dataclass(frozen=True, eq=False, kw_only=True)
class SettledCircles(Outcome):
    """The outcome of the comparison, linearised about the joint fit.

    Attributes:
        after: joint fit of base and named causes.
        noise: estimated with all causes.
        scatter: of balls, in stated standard deviations.
    """

    after: Calibration
    target: Floats
    unmodelled: Unmodelled
    noise: Spectrum
    left: Misfit
    scatter: float = 1.0

    def second_start_agrees(self) -> bool:
        """Return whether a search without seeds agrees."""
        anew = search(self.comparison, self.causes, most_members=BOUNDS.members, likely=BOUNDS.close)
        return anew.best.names == max(self.posterior.weights, key=self.posterior.weights.__getitem__)

    @property
    def members(self) -> tuple[Member, ...]:
        """Return the best hypothesis's named causes."""
        return tuple(m for m in self.best.members if m.cause.named)

    @cached_property
    def remainder(self) -> Remainder:
        """Return the most significant features that the joint fit leaves."""
        return remainder_of(self.after, self.noise)

    @property
    def noise_mm(self) -> float:
        """Return the white noise per sample that affects smooth quantities equally [mm]."""
        return float(np.sqrt(self.noise.power[0]))


@dataclass(frozen=True, eq=False)
class Explained:
    """Inputs and results of the comparison."""

    before: Calibration
    outliers: tuple[Outlier, ...]
    channel: CircleChannel
    first: Misfit
    settled: SettledCircles


GRID = 0.3
"""Relative prior standard deviation of nonlinear parameters in a second try, about their grid spacing."""

ROUGH = 0.1
"""Relative error of a law at the best point of a grid over its nonlinear parameters, which lie an octave apart. Before the
first joint fit, fainter causes may only fit this error: a spike that did so led a wind-up to a wrong length, for which the
law was given up."""

IDLE = 0.9
"""A nonlinear parameter is undetermined if its uncertainty exceeds this share of the prior: the runs then contain less
than a quarter of the prior's information."""


def explain(
    machine: Machine,
    runs: Sequence[Observation],
    sources: Sequence[ErrorSource],
    progress: Callable[[str], None],
    *,
    until_interrupted: bool = False,
) -> Explained:
    """Compare sets of causes; certainly displaced balls and wrong bars are freed."""
    progress("kinematic calibration")
    fit = partial(calibrate, machine)
    before, outliers = calibrate_robust(fit, runs, balls=False)

    def settle(about: Calibration) -> tuple[CircleChannel, SettledCircles]:
        progress("candidates")
        channel = CircleChannel(about, sources)
        return channel, _Settling(channel, progress).run(until_interrupted=until_interrupted)

    explained = _with_set_up(fit, before, outliers, settle)
    if explained.settled.members and outliers and not explained.settled.stopped:
        belonging, staying = in_place_after_all(explained.settled.after, runs, outliers)
        if len(staying) < len(outliers):
            del explained  # free its columns before the next ones need as much memory
            return _with_set_up(fit, fit(belonging), staying, settle)
    return explained


def loud(best: Hypothesis) -> Hypothesis:
    """Return the set without named causes that are faint enough to fit only the initial error of a louder law."""
    rough = [f for m, f in zip(best.members, best.log_factors, strict=True) if m.variant.nonlinear]
    least = ROUGH**2 * max(rough, default=0.0)
    faint = [m.name for m in best.members if m.cause.named and best.log_factor(m.name) < least]
    return replace(best, members=best.without(*faint))


def without(explained: Explained, names: Collection[str]) -> Explained:
    """Return the result with the best hypothesis without these causes, jointly fitted."""
    settled = explained.settled
    posterior = settled.posterior
    best = next((h for h in posterior.hypotheses if not h.names.intersection(names)), Hypothesis((), 0.0))
    return replace(
        explained, settled=_fitted_as_named(explained.channel, replace(settled, posterior=posterior.led_by(best)))
    )


def _with_set_up(
    fit: Fit,
    before: Calibration,
    outliers: tuple[Outlier, ...],
    settle: Callable[[Calibration], tuple[CircleChannel, SettledCircles]],
) -> Explained:
    while True:
        channel, settled = settle(before)
        explained = Explained(before, outliers, channel, misfit_of(before, settled.noise), settled)
        off = [m for m in settled.best.members if m.cause.setup]
        off = [m for m in off if settled.posterior.probability([m.name]) >= SURE]
        if not off or len(outliers) >= MOST or settled.stopped:
            return explained
        worst = max(off, key=lambda m: settled.best.log_factor(m.name))
        step = set_free(fit, before, worst.name, worst.variant.label)
        if step is None:
            return explained
        outliers, before = (*outliers, step[0]), step[2]
        del channel, settled, explained  # free their columns before the next ones need as much memory


class _Settling:
    """Compares sets, refines likely causes and fits jointly, until the result is stable."""

    def __init__(self, channel: CircleChannel, progress: Callable[[str], None]) -> None:
        self._channel, self._progress = channel, progress
        self._unmodelled = Unmodelled(channel)
        self._fit, self._noise_mm, self._scatter = channel.calibration, channel.first_noise_mm, 1.0
        self._fitted: frozenset[tuple[str, str]] = frozenset()
        self._laid_out: set[tuple[str, str]] = set()
        self._tried: set[frozenset[tuple[str, str]]] = set()
        self._seeds: dict[frozenset[str], tuple[Member, ...]] = {}
        self._given_up: set[tuple[str, str]] = set()
        self._likely = BOUNDS.close  # until the result is stable only the most probable set is needed

    def run(self, *, until_interrupted: bool) -> SettledCircles:
        """Run until the result is stable or an interruption comes.

        Raises:
            KeyboardInterrupt: in the first round, and in any if not `until_interrupted`.
        """
        self._unmodelled.look(self._fit, (), self._noise_mm)
        stopped, settled = False, self._compared()
        try:
            for left in reversed(range(CIRCLES.rounds - 1)):
                if self._is_done(settled):
                    break
                self._likely = self._likely if left else BOUNDS.likely
                del settled  # free its products before the next ones need as much memory
                settled = self._compared()
        except KeyboardInterrupt:
            if not until_interrupted:
                raise
            # Columns of the previous round may be freed, so the sets are compared again about the last fit.
            stopped, settled = True, self._compared()
        return replace(_fitted_as_named(self._channel, settled), stopped=stopped)

    def _compared(self) -> SettledCircles:
        channel, unmodelled = self._channel, self._unmodelled
        channel.give_back()
        target = channel.target(self._fit)
        noise = channel.noise(target, unmodelled.causes, self._noise_mm)
        self._noise_mm = float(np.sqrt(noise.power[0]))
        self._beside = channel.beside_base(self._noise_mm, self._scatter)
        comparison = self._beside.comparison(target)
        causes = _listed(channel, unmodelled, comparison, self._given_up)
        posterior = search(comparison, causes, self._seeds.values(), most_members=BOUNDS.members, likely=self._likely)
        best = _steady(posterior, self._fitted)
        self._seeds |= {h.names: h.members for h in (best, *posterior.hypotheses[: BOUNDS.seeds])}
        return SettledCircles(
            after=self._fit,
            posterior=posterior.led_by(best),
            comparison=comparison,
            target=target,
            causes=causes,
            unmodelled=unmodelled,
            noise=noise,
            left=misfit_of(self._fit, noise),
            scatter=self._scatter,
        )

    def _is_done(self, settled: SettledCircles) -> bool:
        if self._is_laid_out_better(settled):
            return False
        best = settled.best if self._fitted else loud(settled.best)
        named = _laws(best)
        if named == self._fitted or named in self._tried:
            done, self._likely = self._likely == BOUNDS.likely, BOUNDS.likely
            return done
        self._tried.add(named)
        self._progress("joint fit with " + (", ".join(sorted(name for name, _ in named)) or "nothing more"))
        joint = _joint(self._channel, settled.comparison, best)
        if joint is None:
            return True
        if idle := _idle_laws(joint, self._channel):
            self._given_up |= idle
            return False
        if not self._fitted:
            self._unmodelled.look(joint, best.members, self._noise_mm)
        self._fit, self._fitted = joint, named
        _refine(self._channel, joint, named)
        return False

    def _is_laid_out_better(self, settled: SettledCircles) -> bool:
        usual = _usual_scatter(self._fit) if any(m.cause.setup for m in settled.best.members) else self._scatter
        rough = [(m, r) for m, r in _with_rivals(settled) if (r.name, r.variant.law) not in self._laid_out]
        if rough:
            target = self._channel.target(self._fit)
            for member, rival in rough:
                self._laid_out.add((rival.name, rival.variant.law))
                _lay_out(self._channel, self._beside, settled.best, member, rival, self._fit, target)
        wider = usual > self._scatter
        self._scatter = max(usual, self._scatter)
        return bool(rough) or wider


def _with_rivals(settled: SettledCircles) -> list[tuple[Member, Member]]:
    named = [cause for cause in settled.causes if cause.named]
    pairs = [(member, member) for member in settled.members]
    pairs += [(member, rival) for member in settled.members for rival in _by_other_laws(settled, member)]
    return pairs + [(member, rival) for member in settled.members for rival in in_place_of(member.name, settled, named)]


def _by_other_laws(settled: SettledCircles, member: Member) -> list[Member]:
    """Return a member once with each other law of its cause, because a law on its grid cannot compete with a refined one."""
    scan = settled.comparison.scan(_lawful(settled.best, member.name), other_laws(member))
    return [replace(one, cause=member.cause) for one in scan.best]


def _lawful(best: Hypothesis, *but_for: str) -> tuple[Member, ...]:
    """Return the members of a joint fit, without unnamed effects, because these would fit a law's initial error and preserve it."""
    return tuple(one for one in best.without(*but_for) if one.cause.named or one.cause.setup)


def _listed(
    channel: CircleChannel,
    unmodelled: Unmodelled,
    comparison: ModelComparison,
    given_up: Collection[tuple[str, str]],
) -> tuple[Cause, ...]:
    """Return the causes to compare: named causes without abandoned laws, set-up faults and unnamed effects."""
    forms = [variant for cause in unmodelled.causes for variant in cause.variants]
    known = dict(zip(map(id, forms), named_already(comparison, forms, channel.forms()), strict=True))
    nameless = [cause for cause in map(partial(_but_for, known=known), unmodelled.causes) if cause.variants]
    lawful = (
        replace(c, variants=tuple(v for v in c.variants if (c.name, v.law) not in given_up)) for c in channel.named
    )
    return (*lawful, *channel.set_up, *nameless)


def _but_for(cause: Cause, known: Mapping[int, bool]) -> Cause:
    kept = [v for v in cause.variants if not known[id(v)]]
    if [v.label for v in kept] == [EACH]:
        kept = []
    return cause if len(kept) == len(cause.variants) else replace(cause, variants=tuple(kept))


def _idle_laws(fit: Calibration, channel: CircleChannel) -> set[tuple[str, str]]:
    """Return laws with undetermined nonlinear parameters and a simpler alternative."""
    # Undetermined means at a limit, or as uncertain as the prior. If a fit without convergence has no such parameter,
    # all laws are simplified.
    sigma, prior = np.sqrt(fit.solution.variance), fit.layout.known.prior
    idle, all_of_them = set(), set()
    for term in fit.layout.terms:
        source = term.source
        simpler = source.simpler_law
        if simpler is None or (source.name, simpler) not in channel.sources:
            continue
        all_of_them.add((source.name, source.law))
        shapes = fit.layout.columns_of(source.name)[1]
        if (np.isin(shapes, fit.at_limit) | (sigma[shapes] > IDLE * prior[shapes])).any():
            idle.add((source.name, source.law))
    return idle if idle or fit.settled else all_of_them


def _fitted_as_named(channel: CircleChannel, settled: SettledCircles) -> SettledCircles:
    """Return the result with a joint fit of exactly its named causes, if rounds alternated."""
    base = {term.source.name for term in channel.calibration.layout.terms}
    fitted = {term.source.name for term in settled.after.layout.terms} - base
    if fitted == {m.name for m in settled.members}:
        return settled
    joint = _joint(channel, settled.comparison, settled.best)
    if joint is not None:
        return replace(settled, after=joint, left=misfit_of(joint, settled.noise))
    posterior, before = settled.posterior, channel.calibration
    for one in posterior.hypotheses:
        if {m.name for m in one.members if m.cause.named} == fitted:
            return replace(settled, posterior=posterior.led_by(one))
    nothing = posterior.led_by(Hypothesis((), 0.0))
    return replace(settled, after=before, posterior=nothing, left=misfit_of(before, settled.noise))


def _laws(hypothesis: Hypothesis) -> frozenset[tuple[str, str]]:
    return frozenset((m.name, m.variant.law) for m in hypothesis.members if m.cause.named)


def _steady(posterior: Posterior, fitted: frozenset[tuple[str, str]]) -> Hypothesis:
    top = posterior.best.log_posterior
    for hypothesis in posterior.hypotheses:
        if hypothesis.log_posterior < top - BOUNDS.close:  # exact fits would not change the decision
            break
        if _laws(hypothesis) == fitted:
            return hypothesis
    return posterior.best


def _joint(channel: CircleChannel, comparison: ModelComparison, best: Hypothesis) -> Calibration | None:
    members = [member for member in best.members if member.cause.named]
    if not members:
        return channel.calibration
    lawful = replace(best, members=_lawful(best))
    start = {
        m.name: values
        for m, values in zip(lawful.members, _estimated(channel, comparison, lawful), strict=True)
        if values is not None
    }
    every = [*default_sources(), *(channel.source_of(m.name, m.variant) for m in members)]
    for within in (None, GRID):
        # A hardly determined shape, such as a decay shorter than the sampling, diverges together with its amplitude.
        try:
            return calibrate(
                channel.machine,
                channel.observations,
                every,
                start,
                shapes_within=within,
                amplitudes_within=float(SCALES[-1]),
                must_settle=within is None,
                also_held=channel.held,
            )
        except (CalibrationError, KinematicsError):
            continue
    return None


def _estimated(channel: CircleChannel, comparison: ModelComparison, hypothesis: Hypothesis) -> list[Floats | None]:
    found: list[Floats | None] = []
    for member, own, _ in comparison.estimated(hypothesis.members):
        if not member.cause.named:
            found.append(None)
            continue
        over = channel.over[member.name, member.variant.law]
        grids = [p.grid for p in over.shapes]
        whole = channel.to_whole(member.variant) @ own[: member.width]
        tangents = own[member.width :][: len(grids)] if len(member.variant.slack) else 0.0
        point = np.clip(np.array(member.variant.nonlinear) + tangents, [*map(min, grids)], [*map(max, grids)])
        found.append(at_point(over.source, channel.machine, point, whole[: len(over.amplitudes)]))
    return found


def _refine(channel: CircleChannel, fit: Calibration, named: Collection[tuple[str, str]]) -> None:
    for name, law in sorted(named):
        values = {term.shared: fit.x[term.columns] for term in fit.layout.terms if term.source.name == name}
        channel.refine(name, law, values, fit)


def _lay_out(
    channel: CircleChannel,
    beside: BesideBase,
    best: Hypothesis,
    member: Member,
    rival: Member,
    fit: Calibration,
    target: Floats,
) -> None:
    others = _lawful(best, member.name)
    name, law = rival.name, rival.variant.law
    for _ in range(BOUNDS.steps_of_rivals if rival.variant.nonlinear else 1):
        hypothesis = Hypothesis((*others, rival), 0.0)
        own = np.unique(all_columns(hypothesis.members))
        values = _estimated(channel, beside.comparison(target, own), hypothesis)[-1]
        if values is None or not values.any():
            return
        channel.refine(name, law, dict.fromkeys(channel.over[name, law].shared, values), fit)
        if not rival.variant.nonlinear:
            return
        refined = next(c for c in channel.named if c.name == name)
        same = next(v for v in refined.variants if v.label == rival.variant.label and v.law == law)
        rival = replace(rival, cause=refined, variant=same)


def _usual_scatter(fit: Calibration) -> float:
    seats = [seat for seat in seats_of(fit) if seat.freedom > 0]
    if not seats:
        return 1.0
    return float(np.sqrt(max(1.0, np.median([seat.square / float(chdtri(seat.freedom, 0.5)) for seat in seats]))))
