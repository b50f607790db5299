"""Derive findings from probabilities of sets: verdict, size, named values, place, equivalents."""

from __future__ import annotations

from collections.abc import Mapping  # noqa: TC003 - types of fields are read when results are written
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Annotated

import numpy as np

from dbbstation.facts.serialise import Kept
from dbbstation.facts.value import Value
from dbbstation.inference.alternatives import EVEN, Alternatives, norm_over_sigma, standing_out, would_show
from dbbstation.inference.bank import amplitudes_of
from dbbstation.inference.channel import Kind, impossible, impossible_beside
from dbbstation.inference.coloured import widening_of
from dbbstation.inference.folds import weighted_jackknife
from dbbstation.inference.forms import HARMONICS
from dbbstation.inference.levels import (
    ABSENT,
    JOINED,
    OUT,
    SURE,
    Acts,
    FollowsAnswer,
    Gains,
    Said,
    Verdict,
    ambiguous,
    open_to,
    too_many,
    within_a_step,
)
from dbbstation.inference.looks import IN_TIME
from dbbstation.inference.model_comparison import SCALES, amplitude_size, slices_of
from dbbstation.inference.patterns import ZEROS, Family, covers_turns, zeros_text
from dbbstation.inference.square_root import runs_of
from dbbstation.inference.stretches import SHORTEST
from dbbstation.inference.triangle import rms, root

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.channel import Law
    from dbbstation.inference.folds import KnownGains
    from dbbstation.inference.followed import ChosenWithoutParts
    from dbbstation.inference.levels import Followed, Levels
    from dbbstation.inference.model_comparison import Cause, Member, Variant
    from dbbstation.inference.settle import Settled
    from dbbstation.inference.square_root import Solution


def named_values(settled: Settled, member: Member, values: Floats, covariance: Floats) -> dict[str, Value]:
    """Return amplitudes and nonlinear parameters; uncertainties include slack."""
    law, covariance = settled.bank.laws.get(member.name), widening_of(settled.bank.tails) * covariance
    if law is not None:
        found = values_of_law(law, member, values, covariance, law.form_uncertainty)
        if any(
            v.kind is Kind.TIME
            for name in settled.best.names & set(settled.bank.patterns)
            for v in settled.bank.patterns[name].variables
        ):
            found.pop("zero", None)  # part of it is in the drift
        return found
    sigma, width = np.sqrt(np.maximum(np.diag(covariance), 0.0)), member.width
    pattern = settled.bank.patterns[member.name]
    unit = settled.channel.unit
    if len(pattern.per) < width:
        return {}
    names = _NAMES.get(str(pattern.family), tuple(f"amplitude {k + 1}" for k in range(width)))[:width]
    return {
        name: Value(float(values[k] / pattern.per[k]), float(sigma[k] / pattern.per[k]), _unit(unit, pattern.units[k]))
        for k, name in enumerate(names)
    }


def values_of_law(law: Law, member: Member, values: Floats, covariance: Floats, share: float) -> dict[str, Value]:
    """Return a law's amplitudes and nonlinear parameters; `share` is the least relative uncertainty of amplitudes, and without tangent a parameter's uncertainty is NaN."""
    sigma, width, every = np.sqrt(np.diag(covariance).clip(0.0)), member.width, len(law.plausible)
    found = {
        law.parameters[j]: Value(float(values[k]), float(np.hypot(sigma[k], share * values[k])), law.units[j])
        for k, j in enumerate(amplitudes_of(member.variant).tolist())
    }
    per = growth(member, values)
    shaped = moved(law, member, values, per)
    for k, name in enumerate(law.parameters[every:]):
        known = len(member.variant.slack) > k
        found[name] = Value(shaped[k], float(sigma[width + k] / per) if known else np.nan, law.units[every + k])
    if law.zero_from is not None and values[0]:
        moved_by = float(values[1] / values[0])
        slopes = np.array([moved_by, -1.0]) / values[0]
        u = root(slopes @ covariance[:2, :2] @ slopes)
        found["zero"] = Value(law.zero_from - moved_by, u, law.variables[0].unit)
    return found


def moved(law: Law, member: Member, values: Floats, per: float = 1.0) -> tuple[float, ...]:
    """Return nonlinear parameters corrected by their tangents, within grids.

    Args:
        per: `growth` for tangents of another form.
    """
    nonlinear = list(member.variant.nonlinear)
    if len(member.variant.slack):
        for k, grid in enumerate(law.grids):
            by = values[member.width + k] / per
            nonlinear[k] = float(np.clip(nonlinear[k] + by, grid[0], grid[-1]))
    return tuple(nonlinear)


def growth(member: Member, values: Floats) -> float:
    """Return the ratio of a member's amplitudes to the amplitudes of its tangents."""
    if not len(member.variant.slack):
        return 1.0
    size = amplitude_size(member, values[: member.width])
    return size / member.variant.slack_at if size > 0.0 else 1.0


def label_of(settled: Settled, member: Member, values: Floats) -> str:
    """Return the variant's label, for a product with its fitted zeros."""
    pattern, width = settled.bank.patterns.get(member.cause.name), len(member.variant.columns)
    if pattern is None or not pattern.slack:
        return member.variant.label
    label = [text for _, _, text in pattern.choices].index(member.variant.label)
    lines = [v for v in pattern.variables if not covers_turns(v)]
    begun = list(product(ZEROS, repeat=len(lines)))[label]
    own, moving = values[:width], values[width:].reshape(-1, width)[::-1]
    zeros = begun - moving @ own / max(float(own @ own), 1e-300)
    return f"about {zeros_text(lines, zeros.tolist())}"


def values_of_members(settled: Settled, members: Sequence[Member]) -> dict[str, dict[str, Value]]:
    """Return values of members that are fitted together, by name."""
    return {one[0].name: named_values(settled, *one) for one in settled.comparison.estimated(members)}


def with_jackknife(
    found: Mapping[str, Value], without: Sequence[Mapping[str, Value]], most: float = np.inf
) -> dict[str, Value]:
    """Return values with the larger of stated and jackknife uncertainty.

    Args:
        without: values without one part each; some may lack a value.
        most: largest weight of a part. For k selections without one part each, in which noise and other effects change,
            it is 1 - 1 / k [Mosteller and Tukey, Data Analysis and Regression, 1977, ch. 8].
    """
    every = {}
    for name, value in found.items():
        others = [(part[name].value, part[name].uncertainty) for part in without if name in part]
        parts = np.array(others).reshape(-1, 2)
        own, there = np.square(value.uncertainty), max(len(parts), 1)
        variances = np.maximum(np.square(parts[:, 1]), own / most)
        u = weighted_jackknife(np.array(value.value), np.array(own), parts[:, 0], variances)
        every[name] = value.at_least(float(u * np.sqrt(len(without) / there)))
    return every


_NAMES = {
    "linear": ("slope",),
    "drift": ("slope",),
    "once per turn": ("cosine", "sine"),
    "twice per turn": ("cosine", "sine"),
    "wave": ("cosine", "sine", *(f"{name} {k}" for k in range(2, max(HARMONICS) + 1) for name in ("cosine", "sine"))),
    "hysteresis": ("half width",),
    "speed": ("per speed",),
    "drag": ("coefficient",),
    "lag": ("delay",),
    "product": ("coefficient",),
    "bump": ("height",),
    "step": ("height",),
}


def _unit(unit: str, per: str) -> str:
    return f"{unit}{per}" if per == "" or per.startswith(("/", " per")) else per


@dataclass(frozen=True)
class Span:
    """A range of a variable in which an effect is present."""

    variable: str
    low: float
    high: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class CauseFinding:
    """Finding on one cause.

    Attributes:
        form: family of a pattern; None for a law.
        rms: with the base projected out, over the effect's rows, in the residual's unit.
        sigmas: norm of the effect over its standard deviation.
        confounded: R² of the effect on base columns.
        spans: ranges of variables with at least half the largest effect.
        rows_there: number of rows with the effect; 0 if not computed.
        rows: first and last row of each stretch; may be empty.
        equivalent: indistinguishable causes, this one first; may be empty.
        ambiguous_with: if this cause is absent, one of these is present.
        gains: held-out gains; None if not tested.
        persists: whether held-out parts confirm a single event.
        recurs: whether a wave over time predicts parts omitted from its selection.
    """

    name: str
    verdict: Verdict
    acts: Acts = Acts.ALWAYS
    persists: bool = False
    recurs: bool = False
    gains: Gains | None = None
    form: Family | None = None
    variables: tuple[str, ...] = ()
    probability: float = 0.0
    log_bayes_factor: float = 0.0
    rms: float = 0.0
    sigmas: float = 0.0
    confounded: float = 0.0
    values: dict[str, Value] = field(default_factory=dict)
    spans: tuple[Span, ...] = ()
    rows_there: float = 0
    rows: tuple[tuple[int, int], ...] = ()
    blocks: Mapping[str, float] = field(default_factory=dict)
    equivalent: tuple[str, ...] = ()
    ambiguous_with: tuple[str, ...] = ()
    text: str = ""
    label: Annotated[str, Kept] = ""
    whole_rms: Annotated[float, Kept] = 0.0


@dataclass(frozen=True, eq=False)
class Trial:
    """Evidence of held-out parts on findings.

    Attributes:
        refits: from `refits_without`; empty to use only model uncertainties.
        chosen: values by member of selections without one part each; may be empty.
    """

    held_out: ChosenWithoutParts | KnownGains | None = None
    refits: Sequence[Solution] = ()
    chosen: Sequence[Mapping[str, Mapping[str, Value]]] = ()


def read_off(settled: Settled, trial: Trial, levels: Levels) -> tuple[CauseFinding, ...]:
    """Return one finding per law and pattern, ordered by presence, then size.

    Args:
        trial: evidence of held-out parts.
        levels: source of the verdicts.
    """
    return CauseJudge(settled, trial, levels).every()


class CauseJudge:
    """Makes findings on causes. Clients derive classes with other words and values.

    Attributes:
        is_catalogue: whether users ask for causes by name; an improbable cause that answer 3 leaves open is then absent.
    """

    is_catalogue = False

    def __init__(self, settled: Settled, trial: Trial, levels: Levels) -> None:
        self._trial, self._rows = trial, settled.channel.rows_are
        self._settled, self._best = settled, settled.best
        self._members = {member.name: member for member in self._best.members}
        self._without = settled.bank.base_values(np.zeros(len(settled.channel.residual)))
        named = [member for member in self._best.members if member.name not in settled.bank.nameless]
        self._alternatives = Alternatives(settled, named)
        self._classes = self._alternatives.classes
        self._values = {m.name: (v, c) for m, v, c in settled.comparison.estimated(self._best.members)}
        self._own = dict(zip(self._members, slices_of(self._best.members), strict=True))
        self._levels = levels
        absent = [cause for cause in settled.causes if cause.name not in self._members]
        scan = settled.comparison.scan(self._best.members, absent)
        self._beside = {c.name: (float(g), m) for c, g, m in zip(scan.causes, scan.log_factor, scan.best, strict=True)}

    def every(self) -> tuple[CauseFinding, ...]:
        """Return one finding per cause and refused law, ordered by presence, then size."""
        found = [self.finding(cause) for cause in self._settled.causes]
        found += [self._refused(name, why) for name, why in self._settled.refused.items()]
        return tuple(sorted(found, key=lambda one: (one.verdict.rank, -one.log_bayes_factor)))

    def _refused(self, name: str, why: str) -> CauseFinding:
        blocks = dict.fromkeys(self._settled.channel.names, 0.0)
        return CauseFinding(name=name, verdict=Verdict.RULED_OUT, blocks=blocks, text=why)

    def finding(self, cause: Cause) -> CauseFinding:
        """Return the finding on a cause."""
        pattern = self._settled.bank.patterns.get(cause.name)
        member = self._members.get(cause.name)
        equal = self._equal(cause.name)
        probability = self._settled.probability(equal)
        gain, shown = self._beside[cause.name] if member is None else (self._best.log_factor(cause.name), member)
        if member is None:
            # The prior must not limit the size that could be hidden.
            shown = replace(shown, scale=float(SCALES[-1]))
            beside = self._best.without(*self._instead_of(cause.name))
            _, values, covariance = self._settled.comparison.estimated([shown, *beside])[0]
        else:
            values, covariance = self._values[cause.name]
        sigmas = self._sigmas(shown, values, covariance)
        effect = self._settled.bank.samples(shown.columns) @ values
        whole, beyond, confounded = self._concealed(shown, effect, values)
        verdict, others, text = self._verdict(cause, member, probability, sigmas)
        gains = self._gains(cause.name) if member is not None else None
        of = self._settled.bank.of(cause.name)
        variables = of.variables if of else ()
        there = verdict.may_be_there and (member is not None or verdict is Verdict.IDENTIFIED)
        runs = runs_of(np.abs(effect) > 0.0) if there and pattern is not None and pattern.family == "pulses" else []
        rows = tuple((run.start, run.stop - 1) for run in runs)
        happened = verdict is Verdict.HAPPENED and gains is not None and gains.predicts
        lasts = pattern is None or pattern.family is Family.STEP or self._is_a_step(rows)
        away = np.abs(effect - np.median(effect))
        largest = away >= 0.5 * away.max() if there else np.zeros(0, dtype=bool)
        channel = self._settled.channel
        return CauseFinding(
            name=cause.name,
            verdict=verdict,
            form=of.family if of else None,
            label=label_of(self._settled, shown, values),
            variables=tuple(v.name for v in variables),
            probability=probability,
            log_bayes_factor=gain,
            rms=beyond,
            sigmas=sigmas,
            whole_rms=whole,
            confounded=confounded,
            values=self._values_of(shown, values, covariance),
            spans=tuple(_span(v.values[largest], v.name, v.unit) for v in variables) if there else (),
            rows_there=int(largest.sum()),
            rows=rows,
            blocks={n: rms(effect[r] - effect.mean()) for n, r in zip(channel.names, channel.blocks, strict=True)}
            if there
            else {},
            equivalent=equal if len(equal) > 1 else (),
            ambiguous_with=others,
            text=text,
            acts=self._acts(cause.name),
            gains=gains,
            persists=happened and lasts,
            recurs=happened and pattern is not None and pattern.family is Family.WAVE,
        )

    def _pushes(self) -> dict[str, Sequence[Value]]:
        unit, patterns = self._settled.channel.unit, self._settled.bank.patterns
        found: dict[str, Sequence[Value]] = {}
        for name in (n for n in self._values if n in patterns and patterns[n].family in IN_TIME):
            values, covariance = self._values[name]
            sigmas = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
            found[name] = [Value(float(v), float(s), unit) for v, s in zip(values, sigmas, strict=True)]
        return found

    def _gains(self, name: str) -> Gains | None:
        if self._trial.held_out is None:
            return None
        return self._trial.held_out.gains_of({self._settled.bank.kind_of(one) for one in self._equal(name)})

    def _acts(self, name: str) -> Acts:
        pattern, law = self._settled.bank.patterns.get(name), self._settled.bank.laws.get(name)
        if pattern is None:
            return Acts.ONCE if law is not None and law.acts_once else Acts.ALWAYS
        over_time = any(variable.kind is Kind.TIME for variable in pattern.variables)
        once = over_time or pattern.acts_once or pattern.family in (*IN_TIME, Family.BLOCKS)
        return Acts.ONCE if once else Acts.ALWAYS

    def _is_a_step(self, rows: tuple[tuple[int, int], ...]) -> bool:
        if len(rows) != 1:
            return False
        (first, last), blocks = rows[0], self._settled.channel.blocks
        return any(0 <= first - b.start < SHORTEST or 0 <= b.stop - 1 - last < SHORTEST for b in blocks)

    def _values_of(self, member: Member, values: Floats, covariance: Floats) -> dict[str, Value]:
        found = named_values(self._settled, member, values, covariance)
        own = self._own.get(member.name)
        if own is None or not self._trial.refits:
            return found
        first = len(self._settled.channel.base.names)
        inside = slice(first + own.start, first + own.stop)
        parts = [(one.x[inside], one.covariance[inside, inside]) for one in self._trial.refits]
        found = with_jackknife(found, [named_values(self._settled, member, *part) for part in parts])
        chosen = [one.get(member.name, {}) for one in self._trial.chosen]
        return with_jackknife(found, chosen, 1.0 - 1.0 / max(len(chosen), 2))

    def _verdict(self, cause: Cause, member: Member | None, probability: float, sigmas: float) -> Said:
        if member is not None or self._instead_of(cause.name):
            return self._of_member(cause.name, probability, sigmas)
        if why := self._impossible_in_place(cause):
            return Verdict.RULED_OUT, (), why
        if alike := self._alike(cause.name):
            return Verdict.AMBIGUOUS, (alike,), f"Nothing measured here tells it from {alike}."
        if probability < EVEN:
            return self._absent(cause, probability)
        others = self._alternatives.ambiguity(cause.name)
        return ambiguous(self._rows, others, f"These {self._rows} do not decide it.")

    def _of_member(self, name: str, probability: float, sigmas: float) -> Said:
        """Return the verdict on a member, given its size in standard deviations.

        A class may be certain although each of its members is uncertain. Held-out parts cannot refute a single member then.
        """
        rows, classes = self._rows, [one for one in self._levels.follows if name in one.members]
        answers = {one.answer for one in classes}
        unsure = probability < SURE and FollowsAnswer.DOES_NOT_PREDICT in answers
        if unsure or FollowsAnswer.UNDECIDED in answers:
            return ambiguous(rows, (), f"These {rows} do not decide it.")
        if sigmas < OUT:
            return Verdict.AMBIGUOUS, (), f"Its effect is only {sigmas:.2g} standard deviations out."
        if self._acts(name) is Acts.ONCE or any(one.in_time for one in classes):
            return self._happened(name)
        if FollowsAnswer.DOES_NOT_PREDICT in answers:
            why = f"It was found in these {rows}, and held-out parts gain nothing by it."
            return Verdict.DOES_NOT_PREDICT, (), why
        if FollowsAnswer.NOT_TESTED in answers and self._levels.correction is False:
            why = "With everything that was found these rows are left worse than as simulated."
            return Verdict.DOES_NOT_PREDICT, (), why
        return _of_laws(classes, name, rows)

    def _happened(self, name: str) -> Said:
        pushes = self._pushes()
        every = [size for own in pushes.values() for size in own]
        if name in pushes and (why := within_a_step(pushes[name], self._settled.channel.step) or too_many(every)):
            return Verdict.AMBIGUOUS, (), why
        refuted = any(one.answer is FollowsAnswer.DOES_NOT_PREDICT for one in self._levels.follows)
        if refuted and self._levels.correction is False:
            return Verdict.AMBIGUOUS, (), MAKES_UP
        return Verdict.HAPPENED, (), ""

    def _instead_of(self, name: str) -> frozenset[str]:
        """Return members that a named law outside the set replaces."""
        replaced = (one.members for one in self._levels.follows if _named(one, name) and name not in self._members)
        return frozenset[str]().union(*replaced)

    def _alike(self, name: str) -> str:
        """Return a member equivalent to a cause or ambiguous with it; may be empty."""
        equal = any(name in names for names in self._classes.values())
        if self.is_catalogue and not equal and self._settled.posterior.probability([name]) <= ABSENT:
            return ""
        for one in self._levels.follows:
            if one.form is not None and name in (*one.form.not_worse, *one.form.names):
                return next(other for other in (*one.form.names, *sorted(one.members)) if other != name)
        unsure = self._alternatives.ambiguities
        return next((one for of in (self._classes, unsure) for one, names in of.items() if name in names), "")

    def _equal(self, name: str) -> tuple[str, ...]:
        """Return a named law and its equivalents, or a cause and its class."""
        forms = [one.form for one in self._levels.follows if one.form is not None and one.form.name == name]
        same = dict.fromkeys(other for form in forms for other in form.not_worse)
        return (name, *same) if same else self._classes.get(name, (name,))

    def _impossible_in_place(self, cause: Cause) -> str:
        shown = replace(self._beside[cause.name][1], scale=float(SCALES[-1]))
        alike = [name for name, equal in self._classes.items() if cause.name in equal]
        if not alike and not any(shown.variant.positive):
            return ""
        return self._impossible(*self._settled.comparison.estimated([shown, *self._best.without(*alike)])[0])

    def _impossible(self, shown: Member, values: Floats, covariance: Floats) -> str:
        law = self._settled.bank.laws.get(shown.name)
        if law is None:
            return ""
        own = values_of_law(law, shown, values, covariance, law.form_uncertainty)
        every = self._of_laws | {name: value.value for name, value in own.items()}
        # An insignificantly negative value may be zero.
        signed = [name for name, sign in zip(law.parameters, law.positive, strict=False) if sign and name in own]
        every |= {name: max(every[name], 0.0) for name in signed}
        return impossible(law, shown.variant, values, covariance) or impossible_beside(law, own, every)

    @cached_property
    def _of_laws(self) -> dict[str, float]:
        laws = self._settled.bank.laws
        told = [values_of_law(laws[n], m, *self._values[n], 0.0).items() for n, m in self._members.items() if n in laws]
        return {name: value.value for values in told for name, value in values}

    def _absent(self, cause: Cause, probability: float) -> Said:
        variant = cause.widest
        if not self._would_show(variant, self._best.members):
            if self._would_show(variant, ()):
                beside = next((n for n in self._members if self._would_show(variant, self._best.without(n))), None)
                what = beside or "what was found"
                return Verdict.NOT_TESTABLE, (), f"Beside {what} these {self._rows} would not show it."
            samples = self._settled.bank.fitted(variant.columns) / self._settled.noise.innovation
            if would_show(standing_out(samples.T @ samples, variant.plausible)):
                return Verdict.NOT_TESTABLE, (), "The fitted parameters would take it up."
            return Verdict.NOT_TESTABLE, (), f"These {self._rows} would not show it at its plausible size."
        return open_to(self._rows) if probability > ABSENT else (Verdict.RULED_OUT, (), NOT_NEEDED)

    def _would_show(self, variant: Variant, others: tuple[Member, ...]) -> bool:
        products = self._settled.comparison.beside(others, variant.columns)
        return would_show(standing_out(products, variant.plausible))

    def _sigmas(self, member: Member, values: Floats, covariance: Floats) -> float:
        return norm_over_sigma(self._settled.comparison.beside((), member.columns), values, covariance)

    def _concealed(self, _shown: Member, effect: Floats, _values: Floats) -> tuple[float, float, float]:
        kept = effect[self._settled.channel.kept]
        fitted = self._settled.bank.base_values(-effect) - self._without
        rest = kept - (self._settled.channel.base.samples @ fitted)[self._settled.channel.kept]
        return concealed(kept - kept.mean(), rest)


MAKES_UP = "Held-out parts are predicted worse than as simulated, and something beside it predicts none: this may make up for that."
"""Why a single event is uncertain: its probability assumes effects that other rows refute."""


def _named(one: Followed, name: str) -> bool:
    return one.form is not None and name in one.form.names


def _of_laws(classes: Sequence[Followed], name: str, rows: str) -> Said:
    if all(_named(one, name) for one in classes):
        return Verdict.IDENTIFIED, (), ""
    forms = [one.form for one in classes if one.form is not None and not _named(one, name)]
    rivals = [form.rivals.get(name) or (*form.names, *form.not_worse) for form in forms]
    others = tuple(dict.fromkeys(n for names in rivals for n in names if n != name and JOINED not in n))
    return ambiguous(rows, others, "No single law was named here.")


NOT_NEEDED = "It would have been seen at its plausible size and was not needed."


def concealed(effect: Floats, rest: Floats) -> tuple[float, float, float]:
    """Return the rms of an effect, the rms that fitted parameters do not absorb, and the share of squares that they absorb."""
    whole, left = rms(effect), rms(rest)
    return whole, left, float(np.clip(1.0 - (left / whole) ** 2 if whole > 0.0 else 0.0, 0.0, 1.0))


def _span(values: Floats, name: str, unit: str) -> Span:
    return Span(name, float(values.min()), float(values.max()), unit)
