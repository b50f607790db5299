"""The three answers: whether anything differs, which variables it follows, which law it obeys.

Each answer has a probability over all sets and a held-out gain. An uncertain answer does not weaken the previous one.
"""

from __future__ import annotations

from collections.abc import Mapping  # noqa: TC003 - types of fields are read when results are written
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

from dbbstation.facts.serialise import Absent, Kept
from dbbstation.facts.value import Value  # noqa: TC001 - types of fields are read when results are written
from dbbstation.inference.verdict import ABSENT, SURE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.inference.verdict import DensityGains

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
    rest: tuple[float, bool, float, tuple[Detectable, ...]],
    *,
    correction: bool | None = None,
) -> DifferenceFound:
    """Derive answer 1 from answers 2 and 3.

    A single event is no evidence together with effects that other rows refute, because the event may only compensate
    for these.

    Args:
        rest: size of interest, whether it is stated, independent samples, detectable sizes.
    """
    matters, stated, samples, detectable = rest
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
    return DifferenceFound(
        answer,
        why,
        probability,
        matters,
        stated,
        samples,
        detectable,
        None if gains is None else gains.total,
        None if gains is None else gains.without_best,
    )
