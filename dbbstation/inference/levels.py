"""The three answers: whether anything differs, which variables it follows, which law it obeys; verdicts on causes.

Each answer has a probability over all sets and a held-out gain. An uncertain answer does not weaken the previous one.
Verdicts are equal for tables, drives, circles and two sessions; docs/verdicts.md lists tests and words. They follow
from the answers about classes of causes. Events of equal size count once; too many sizes are no events.
"""

from __future__ import annotations

import math
from collections.abc import Mapping  # noqa: TC003 - types of fields are read when results are written
from dataclasses import dataclass, field, replace
from enum import StrEnum, auto
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import computed_field
from scipy.special import chdtri

from dbbstation.facts.serialise import Absent, Kept
from dbbstation.facts.value import Value

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.laws.contract import Texts


SURE = 0.95
"""Probability above which a cause is reported as present: if the models of noise and causes are correct, one claim of twenty is wrong."""

OUT = 5.0
"""Significance, in standard deviations of the norm, of a reported effect, and of an effect that can be ruled out: the
usual limit of discoveries in physics, because effects are picked from many."""

ABSENT = 1.0 - SURE
"""Probability below which a detectable cause is ruled out, as sure as a reported presence. It equals the prior
probability of a named cause, so a cause that the recording supports is never ruled out."""

SURELY = math.log(SURE / ABSENT)
"""Log odds of `SURE`."""

PARTS_WITH_GAIN = 0.7
"""Share of held-out rows in parts with a gain that an effect needs. A useless effect gains by chance in half of the
parts, in seven of ten or more once in six times; then it also needs a total gain without its best part."""

SEEN_WORSE = 1e-3
"""Relative excess of a worse error: about the last of three printed figures."""


class Verdict(StrEnum):
    """Verdicts on a cause, in the order of lists; the values are the tokens of `--json`."""

    IDENTIFIED = "identified"
    HAPPENED = "happened"
    DOES_NOT_PREDICT = "does-not-predict"
    AMBIGUOUS = "ambiguous"
    NOT_TESTABLE = "not-testable"
    RULED_OUT = "ruled-out"

    @property
    def rank(self) -> int:
        """Return the verdict's place in lists."""
        return tuple(Verdict).index(self)

    @property
    def is_there(self) -> bool:
        """Return whether the cause is present."""
        return self in {Verdict.IDENTIFIED, Verdict.HAPPENED}

    @property
    def may_be_there(self) -> bool:
        """Return whether evidence supports the cause."""
        return self.rank <= Verdict.AMBIGUOUS.rank


@dataclass(frozen=True, kw_only=True)
class CatalogueFinding:
    """Finding on a cause that users ask for by name.

    Attributes:
        verdict: see docs/verdicts.md.
    """

    name: str
    verdict: Verdict
    ambiguous_with: tuple[str, ...]


class Acts(StrEnum):
    """Whether other rows or tests can show a cause again."""

    ALWAYS = auto()
    ONCE = auto()


@dataclass(frozen=True)
class Gains:
    """An effect's gain in each held-out part, with selection repeated.

    Attributes:
        parts: squared errors without the effect, other effects refitted, minus squared errors with it; zero if not
            selected.
    """

    parts: tuple[float, ...]
    rows: Annotated[tuple[int, ...], Kept] = ()

    @computed_field  # type: ignore[prop-decorator]
    @property
    def with_gain(self) -> int:
        """Return the number of parts with a gain."""
        return sum(part > 0.0 for part in self.parts)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def total(self) -> float:
        """Return the total gain."""
        return sum(self.parts)

    @property
    def counted(self) -> str:
        """Return the numbers of gaining and all parts, as printed."""
        return f"{self.with_gain} of {len(self.parts)}"

    @property
    def share_with_gain(self) -> float:
        """Return the share of rows in gaining parts."""
        rows = self.rows or (1,) * len(self.parts)
        return sum(count for part, count in zip(self.parts, rows, strict=True) if part > 0.0) / max(sum(rows), 1)

    @property
    def without_best(self) -> float:
        """Return the gain summed over all parts but the best."""
        return self.total - max(self.parts, default=0.0)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def predicts(self) -> bool:
        """Return whether enough parts gain, and the total without the best part is positive."""
        return self.share_with_gain >= PARTS_WITH_GAIN and self.without_best > 0.0


@dataclass(frozen=True)
class DensityGains(Gains):
    """An effect's gain in log predictive density.

    Parts that hardly show the effect contribute little, and the sum is evidence [Good 1952; see `chosen_anew`], so
    gaining parts are not counted.
    """

    @property
    def predicts(self) -> bool:
        """Return whether the held-out parts but the best, together, surely favour the effect."""
        return self.without_best >= SURELY


def is_worse(corrected: float, reference: float) -> bool:
    """Return whether a correction has a larger rms error on held-out rows than the reference."""
    return corrected > (1.0 + SEEN_WORSE) * reference


@dataclass(frozen=True)
class LimitReached:
    """A limit at which a computation ended.

    Attributes:
        what: `search`, `parameter`, `fit` or `stopped`.
        name: source and parameter, such as `play shaking_n`; may be empty.
    """

    what: str
    name: str
    text: str


TIME, RUN = "time", "run"
"""Names of what is followed by effects in single rows or over the clock, and by offsets of runs."""

BALL, BAR = "a ball put up elsewhere", "the bar's length"
"""Names of what set-up faults of circles follow."""

ONCE = frozenset({TIME, RUN, BALL, BAR})
"""Effects in single runs or in time, which other rows cannot show again."""

JOINED = " + "
"""Separator between the names of a sum of laws."""


class Differs(StrEnum):
    """Answer 1: whether a difference exists beyond noise and refit."""

    YES = "yes"
    NO = "no"
    CANNOT_TELL = "cannot tell"


class FollowsAnswer(StrEnum):
    """Answer 2: whether a class of variables is followed."""

    FOLLOWS = "follows"
    GOES_ON = "goes on in time"
    HAPPENED = "happened"
    DOES_NOT_PREDICT = "does not predict"
    NOT_TESTED = "not tested"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Detectable:
    """Smallest detectable effect.

    Attributes:
        size: rms detected in nine of ten cases, in the residual's unit; None if the base absorbs it at any size.
        confirm: measurement that shows it; absent for variables.
    """

    follows: str
    size: float | None
    concealed: float
    confirm: Annotated[str | None, Absent] = None

    @property
    def name(self) -> str:
        """Return the effect in words."""
        return f"an effect over {self.follows}" if self.confirm is None else f"an effect of {self.follows}"


@dataclass(frozen=True)
class DifferenceFound:
    """Answer 1 with its figures.

    Attributes:
        why: reason, unless the answer is a plain yes.
        matters: size of interest, in the residual's unit.
        matters_stated: False if `matters` is the refitted residual.
        gain: held-out log density gain of all effects over the base; None if not tested.
    """

    answer: Differs
    why: str
    probability: float
    matters: float
    matters_stated: bool
    independent_samples: float
    detectable: tuple[Detectable, ...]
    gain: float | None = None
    gain_without_best: float | None = None


@dataclass(frozen=True)
class ScoredLaw:
    """A law, or a sum of laws, as candidate for one class.

    Attributes:
        log_density: held-out log density, relative to no candidate.
    """

    name: str
    log_density: float


@dataclass(frozen=True)
class LawForm:
    """Answer 3: the law of a class.

    Attributes:
        name: the law; None if open.
        not_worse: causes about as good as the law, or as the best if open, with equivalents.
        together: laws that are each named, if a sum is best.
        rivals: for each unnamed member of the sum, equally good causes.
    """

    name: str | None
    not_worse: tuple[str, ...]
    scored: tuple[ScoredLaw, ...]
    together: tuple[str, ...] = ()
    rivals: Annotated[Mapping[str, tuple[str, ...]], Kept] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Return all named laws."""
        return self.together if self.name is None else (self.name,)


@dataclass(frozen=True)
class Followed:
    """Answer 2 for one class of variables.

    Attributes:
        variables: most probable first; one of them is followed.
        or_variables: indistinguishable variables.
        ways: probabilities that it follows value, direction, delay or time.
        before: held-out error without the class; None if not tested.
        gain: held-out gain of log density by the class; None if not tested.
        consequence: whether the variable, as stated, results from the simulation and is no cause.
        may_result: whether the variable contains the difference itself, so it may be cause or consequence.
        form: answer 3; None for time or if nothing is followed.
        slope: of the straight line through the fitted sum over the first variable; None for times and angles.
        straight: share of squares that the line explains.
        where: strut, all struts, or set-up of all tests; None if uncertain.
    """

    variables: tuple[tuple[str, ...], ...]
    or_variables: tuple[str, ...]
    answer: FollowsAnswer
    probability: float
    ways: dict[str, float]
    rms: float
    members: tuple[str, ...]
    before: float | None = None
    after: float | None = None
    gain: float | None = None
    gain_without_best: float | None = None
    parts_with_gain: float | None = None
    consequence: bool = False
    may_result: bool = False
    form: LawForm | None = None
    slope: Value | None = None
    straight: float = 0.0
    where: Annotated[str | None, Absent] = None

    @property
    def in_time(self) -> bool:
        """Return whether the effect follows only time or run, which other rows cannot repeat."""
        return set[str]().union(*self.variables) <= ONCE

    @property
    def name(self) -> str:
        """Return the class in words."""
        return " and ".join(" or ".join(one) for one in self.variables)


@dataclass(frozen=True)
class Levels:
    """All three answers.

    Attributes:
        follows: answers 2 and 3 per class, most probable first; consequences last.
        correction: whether the fitted sum predicts better than the simulation; None if not found or not tested.
    """

    differs: DifferenceFound
    follows: tuple[Followed, ...]
    correction: bool | None

    @property
    def corrects(self) -> frozenset[str]:
        """Return variables that a correction uses; empty for all."""
        return corrects_of(self.follows)

    def times(self, factor: float) -> Levels:
        """Return the answers in another unit."""

        def scaled(size: float | None) -> float | None:
            return None if size is None else factor * size

        differs = self.differs
        sizes = tuple(replace(one, size=scaled(one.size)) for one in differs.detectable)
        follows = (
            replace(one, rms=factor * one.rms, before=scaled(one.before), after=scaled(one.after))
            for one in self.follows
        )
        return replace(
            self,
            differs=replace(differs, matters=factor * differs.matters, detectable=sizes),
            follows=tuple(follows),
        )


CORRECTS = (FollowsAnswer.FOLLOWS, FollowsAnswer.GOES_ON, FollowsAnswer.NOT_TESTED)
"""Answers of classes that a correction uses; single events and classes that do not predict apply to these rows only."""


def corrects_of(classes: Iterable[Followed]) -> frozenset[str]:
    """Return variables that a correction by classes uses; empty for all."""
    every = [one for one in classes if one.answer in CORRECTS]
    own = frozenset(name for one in every for names in one.variables for name in names)
    return own | {name for one in every for name in one.or_variables if name != TIME}


SAYS_YES = (FollowsAnswer.FOLLOWS, FollowsAnswer.GOES_ON, FollowsAnswer.HAPPENED)


def difference_of(
    probability: float,
    classes: tuple[Followed, ...],
    gains: DensityGains | None,
    doubts: tuple[str, ...],
    *,
    correction: bool | None = None,
) -> tuple[Differs, str]:
    """Derive answer 1, with its reason, from answers 2 and 3.

    A single event is no evidence together with effects that other rows refute, because the event may only compensate
    for these.
    """
    answer, why = Differs.NO, ""
    if probability >= SURE:
        answers = {one.answer for one in classes}
        if correction is False and FollowsAnswer.DOES_NOT_PREDICT in answers:
            answers.discard(FollowsAnswer.HAPPENED)
        predicts = gains is None or gains.predicts or not answers.isdisjoint(SAYS_YES)
        answer = Differs.YES if predicts else Differs.CANNOT_TELL
        why = "" if predicts else "it is found here, and held-out parts gain nothing by it"
        if gains is None:
            why = "not tested on held-out parts"
    elif doubts:
        answer, why = Differs.CANNOT_TELL, doubts[0]
    elif probability > ABSENT:
        why = f"something may be there, at probability {probability:.2f}"
    return answer, why


Said = tuple[Verdict, tuple[str, ...], str]
"""A verdict, alternative causes, and the reason."""


def ambiguous(rows: str, others: Sequence[str], otherwise: str) -> Said:
    """Return the verdict on a cause of which the rows do not decide.

    Args:
        others: alternative causes; without any, `otherwise` is the reason.
    """
    text = f"These {rows} cannot tell it from {', '.join(others)}." if others else otherwise
    return Verdict.AMBIGUOUS, tuple(others), text


def with_texts(verdict: Verdict, text: str, texts: Texts) -> str:
    """Return the reason of a verdict, with what a present cause is, and with the measurement that confirms a possible one."""
    what = texts.what if verdict.is_there else ""
    return " ".join(part for part in (what, text, texts.confirm) if part) if verdict.may_be_there else text


def open_to(rows: str) -> Said:
    """Return the verdict on a cause that is neither shown nor excluded."""
    return Verdict.NOT_TESTABLE, (), f"These {rows} leave it open: they neither show nor exclude it."


MOST_PUSHES = 8
"""Most stretches of time with different sizes. Each has three numbers from the residual alone; more could imitate any
residual of a law or noise model."""

ONE_SIZE = 0.999
"""Coverage of the scatter within which pushes have equal size."""


def too_many(sizes: Sequence[Value]) -> str:
    """Return why there are too many sizes for events, else an empty text."""
    distinct = distinct_sizes(sizes)
    if distinct <= MOST_PUSHES:
        return ""
    return (
        f"{len(sizes)} stretches of time would be needed, {distinct} of them of sizes of their own: a form that is not listed, or noise "
        "that comes in pieces, is more likely than so many events."
    )


def within_a_step(sizes: Sequence[Value], step: float) -> str:
    """Return why sizes may be rounding errors, else an empty text.

    The rounding error of slow values, up to half a step, keeps its sign over many rows.

    Args:
        step: zero without rounding.
    """
    if not sizes or any(abs(one.value) - step >= OUT * one.uncertainty for one in sizes):
        return ""
    return f"No stretch of it is larger than the step of {step:.3g} {sizes[0].unit} that is measured in: it may be what was rounded off."


def distinct_sizes(sizes: Sequence[Value]) -> int:
    """Return the number of distinct sizes."""
    return len(sizes) - max(len(most_of_one_size(sizes)) - 1, 0)


def most_of_one_size(sizes: Sequence[Value]) -> list[int]:
    """Return the largest group of sizes equal by chi-square, as ascending indices."""
    order = sorted(range(len(sizes)), key=lambda k: sizes[k].value)
    best: range = range(0)
    for first in range(len(order)):
        while (stop := first + len(best) + 1) <= len(order) and _is_one([sizes[k] for k in order[first:stop]]):
            best = range(first, stop)
    return sorted(order[k] for k in best)


def _is_one(sizes: Sequence[Value]) -> bool:
    mean = pooled(sizes).value
    squares = sum(((one.value - mean) / one.uncertainty) ** 2 for one in sizes)
    return len(sizes) < 2 or squares <= float(chdtri(len(sizes) - 1, 1.0 - ONE_SIZE))  # noqa: PLR2004 - a single size is a group


def pooled(sizes: Sequence[Value]) -> Value:
    """Return the weighted mean with the larger of stated uncertainty and scatter [ISO 13528; Birge 1932]."""
    values, sigmas = (np.array([getattr(one, name) for one in sizes]) for name in ("value", "uncertainty"))
    weights = 1.0 / np.square(sigmas)
    mean = float(weights @ values / weights.sum())
    scatter = float(weights @ np.square(values - mean)) / max(len(values) - 1, 1)
    return Value(mean, float(np.sqrt(max(scatter, 1.0) / weights.sum())), sizes[0].unit)
