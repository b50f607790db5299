"""The answer in three levels: does anything differ, what does it follow, which law is it.

Each level has its own probability, summed over all sets of causes and beginnings of the noise, and its own gain in held-out parts. A level
that is not sure says less; it takes nothing from the level above it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.inference.verdict import ABSENT, SURE

if TYPE_CHECKING:
    from dbbstation.inference.verdict import DensityGains

TIME, RUN = "time", "run"
"""What is followed by what acts in single rows or over the clock, and by offsets of runs."""


class Differs(StrEnum):
    """Level 1: whether measured and simulated values differ beyond noise and refitted parameters."""

    YES = "yes"
    NO = "no"
    CANNOT_TELL = "cannot tell"


class FollowsAnswer(StrEnum):
    """Level 2: what is known of a class of variables."""

    FOLLOWS = "follows"
    GOES_ON = "goes on in time"
    HAPPENED = "happened"
    DOES_NOT_PREDICT = "does not predict"
    NOT_TESTED = "not tested"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Detectable:
    """How large an effect must be to be found.

    Attributes:
        follows: variable, or name of a cause.
        size: root mean square of the effect itself from which on it is found in nine of ten cases, with a margin, in the unit of the
            residual; None where the fitted parameters take up any size.
        concealed: share of its squares that the fitted parameters take up.
    """

    follows: str
    size: float | None
    concealed: float


@dataclass(frozen=True)
class DifferenceFound:
    """Level 1.

    Attributes:
        why: reason, where the answer is not a plain yes.
        matters: size that the user cares about, in the unit of the residual.
        matters_stated: whether the user stated it; else it is what the fitted parameters leave of all rows.
        gain: log density of held-out parts with everything that was chosen, less that of the base alone; None where not tested.
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
        log_density: of held-out parts with it, over nothing in its place.
    """

    name: str
    log_density: float


@dataclass(frozen=True)
class LawForm:
    """Level 3: the law within a class.

    Attributes:
        name: of the law; None where it is open.
        not_worse: causes that predict parts as well as it, or as the best; those that are the same to these rows included.
        scored: all that were compared, best first.
    """

    name: str | None
    not_worse: tuple[str, ...]
    scored: tuple[ScoredLaw, ...]


@dataclass(frozen=True)
class Followed:
    """Level 2: one class of variables.

    Attributes:
        variables: of which one is followed, most probable first; of several classes that the same causes follow, all of these.
        or_variables: that these rows cannot tell from them.
        ways: probability that it is followed by value, by direction, late, or in time.
        rms: of the fitted sum of all that follows them, in the unit of the residual.
        members: causes that do, in the most probable set.
        before: error of held-out rows without these; None where not tested.
        gain: log density of held-out parts with them less that without; None where not tested.
        consequence: whether what is followed results from what is simulated, as the user states: it shows the difference and is
            no cause.
        form: the law; None where the class is not known to be followed, or is the time.
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
    form: LawForm | None = None

    @property
    def name(self) -> str:
        """Of the class, in words."""
        return " and ".join(" or ".join(one) for one in self.variables)


@dataclass(frozen=True)
class Levels:
    """The answer.

    Attributes:
        differs: level 1.
        follows: level 2 with level 3 in it, most probable first.
        correction: whether the fitted sum of everything may be used: it predicts held-out rows better than as simulated; None where
            nothing was found, or nothing was tested.
    """

    differs: DifferenceFound
    follows: tuple[Followed, ...]
    correction: bool | None


SAYS_YES = (FollowsAnswer.FOLLOWS, FollowsAnswer.GOES_ON, FollowsAnswer.HAPPENED)


def difference_of(
    probability: float,
    classes: tuple[Followed, ...],
    gains: DensityGains | None,
    doubts: tuple[str, ...],
    rest: tuple[float, bool, float, tuple[Detectable, ...]],
) -> DifferenceFound:
    """Level 1 from what the levels below it found.

    Args:
        classes: level 2.
        gains: of everything in held-out parts; None: not tested.
        rest: size that matters, whether it was stated, independent samples, and detectable sizes.
    """
    matters, stated, samples, detectable = rest
    answer, why = Differs.NO, ""
    if probability >= SURE:
        predicts = gains is None or gains.predicts or any(one.answer in SAYS_YES for one in classes)
        answer = Differs.YES if predicts else Differs.CANNOT_TELL
        why = "" if predicts else "it is found in these rows, and held-out rows gain nothing by it"
        if gains is None:
            why = "not tested on held-out rows"
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
