"""The three levels: does anything differ, what does it follow, which law.

Each has own probability over all sets and held-out gain. An uncertain level takes nothing from the one above.
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
"""What is followed by what acts in single rows or over the clock, and by offsets of runs."""

BALL, BAR = "a ball put up elsewhere", "the bar's length"
"""What set-up faults of circles follow."""

ONCE = frozenset({TIME, RUN, BALL, BAR})
"""What happens in a run, or goes on in time: no other rows can show it again."""

JOINED = " + "
"""Between the names of a sum of laws."""


class Differs(StrEnum):
    """Level 1: difference beyond noise and refit."""

    YES = "yes"
    NO = "no"
    CANNOT_TELL = "cannot tell"


class FollowsAnswer(StrEnum):
    """Level 2: knowledge of a variable class."""

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
        size: rms found in nine of ten cases, in the residual's unit; None if absorbed at any size.
        confirm: what shows it; absent for variables.
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
    """Level 1.

    Attributes:
        why: reason if not a plain yes.
        matters: size of interest, in the residual's unit.
        matters_stated: False: `matters` is the refitted residual.
        gain: held-out log density of everything over the base; None if not tested.
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
    """A law, or the sum of several, in one place.

    Attributes:
        log_density: held-out, over an empty place.
    """

    name: str
    log_density: float


@dataclass(frozen=True)
class LawForm:
    """Level 3: the law of a class.

    Attributes:
        name: None if open.
        not_worse: causes as good as it or the best, with equivalents.
        together: laws each named in its own place, if a sum is best.
        rivals: of each other member of that sum, causes as good in its own place.
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
    """Level 2: one class of variables.

    Attributes:
        variables: one is followed, most probable first.
        or_variables: indistinguishable ones.
        ways: probability by value, direction, lateness, time.
        rms: fitted sum, in the residual's unit.
        before: held-out error without them; None if not tested.
        gain: held-out log density, with minus without; None if not tested.
        consequence: the variable results from the simulation, as stated, and is no cause.
        may_result: the variable carries the difference itself: cause or consequence.
        form: None if not followed, or time.
        slope: of the straight line through the members' sum over the first variable; None for times and angles.
        straight: share of the squares that the line makes.
        where: strut, all struts, or the set-up of all tests; None if uncertain.
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
        """Return whether the effect follows time or run alone, which other rows cannot repeat."""
        return set[str]().union(*self.variables) <= ONCE

    @property
    def name(self) -> str:
        """Return the class in words."""
        return " and ".join(" or ".join(one) for one in self.variables)


@dataclass(frozen=True)
class Levels:
    """The answer.

    Attributes:
        follows: with level 3, most probable first; consequences last.
        correction: whether the fitted sum predicts better than the simulation; None if nothing was found or tested.
    """

    differs: DifferenceFound
    follows: tuple[Followed, ...]
    correction: bool | None

    @property
    def corrects(self) -> frozenset[str]:
        """Return variables that a correction uses; empty: all."""
        return corrects_of(self.follows)

    def times(self, factor: float) -> Levels:
        """Return the levels in a smaller unit."""

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
"""Answers of classes that a correction is made of: what happened, or predicts nothing, is true of these rows alone."""


def corrects_of(classes: Iterable[Followed]) -> frozenset[str]:
    """Return variables that a correction by classes uses; empty: all."""
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
    """Return level 1 from the others.

    An effect that happened once is no evidence beside effects that other rows refute. It may only make up for them.

    Args:
        rest: size of interest, whether stated, independent samples, detectable sizes.
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
