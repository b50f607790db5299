"""Verdicts of causes, alike for tables, drives, circles and two sessions; docs/verdicts.md has the table of tests and words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum, auto
from typing import Annotated

from pydantic import computed_field

from dbbstation.facts.serialise import Kept

SURE = 0.95
"""Probability from which on something is said to be there: one claim in twenty may be wrong if the model of noise and causes is right."""

OUT = 5.0
"""Standard deviations by which the norm of an effect must be out to be said to be there, or would have to be to be ruled out: physics'
usual limit of a discovery, since effects are picked from many."""

ABSENT = 1.0 - SURE
"""Probability up to which something that would have been seen is ruled out: as sure as what is there. It is the prior probability of a
named cause, so what the recording makes more probable than it was is never ruled out."""

PARTS_WITH_GAIN = 0.7
"""Share of the held-out parts, by rows, in which an effect must bring something. An effect that brings nothing gains by chance in half of them:
in seven of ten or more once in six times, and then still has to gain in sum without its best part."""

SEEN_WORSE = 1e-3
"""Share by which one error must exceed another to be worse: what three printed figures hardly show."""


class Verdict(StrEnum):
    """What can be said of a cause, in the order of listings; the values are the tokens of `--json`."""

    IDENTIFIED = "identified"
    HAPPENED = "happened"
    DOES_NOT_PREDICT = "does-not-predict"
    AMBIGUOUS = "ambiguous"
    NOT_TESTABLE = "not-testable"
    RULED_OUT = "ruled-out"

    @property
    def rank(self) -> int:
        """Return the place in listings."""
        return tuple(Verdict).index(self)


class Acts(StrEnum):
    """Whether other rows or tests can show a cause again."""

    ALWAYS = auto()
    ONCE = auto()


@dataclass(frozen=True)
class Gains:
    """An effect's gain in each held-out part, chosen anew.

    Attributes:
        parts: squared errors without less with it, others refitted, in squared units; zero if not chosen.
    """

    parts: tuple[float, ...]
    rows: Annotated[tuple[int, ...], Kept] = ()

    @computed_field  # type: ignore[prop-decorator]
    @property
    def with_gain(self) -> int:
        """Return the number of parts with gain."""
        return sum(part > 0.0 for part in self.parts)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def total(self) -> float:
        """Return the sum over all parts."""
        return sum(self.parts)

    @property
    def counted(self) -> str:
        """Return the count of gains, as printed."""
        return f"{self.with_gain} of {len(self.parts)}"

    @property
    def share_with_gain(self) -> float:
        """Return the share of rows in gaining parts."""
        rows = self.rows or (1,) * len(self.parts)
        return sum(count for part, count in zip(self.parts, rows, strict=True) if part > 0.0) / max(sum(rows), 1)

    @property
    def without_best(self) -> float:
        """Return the sum without the best part."""
        return self.total - max(self.parts, default=0.0)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def predicts(self) -> bool:
        """Return whether enough parts gain, and the sum without the best."""
        return self.share_with_gain >= PARTS_WITH_GAIN and self.without_best > 0.0


@dataclass(frozen=True)
class DensityGains(Gains):
    """An effect's gain in predictive density.

    Parts that hardly show the effect contribute little, and the sum is evidence [Good, J. R. Stat. Soc. B 14 (1952)
    107], so parts need not be counted.
    """

    @property
    def predicts(self) -> bool:
        """Return whether held-out parts without the best one surely favour the effect."""
        return self.without_best >= math.log(SURE / ABSENT)


def is_worse(corrected: float, reference: float) -> bool:
    """Return whether a correction predicts worse than the reference, by rms on held-out rows."""
    return corrected > (1.0 + SEEN_WORSE) * reference
