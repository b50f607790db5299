"""Verdicts on causes, equal for tables, drives, circles and two sessions; docs/verdicts.md lists tests and words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum, auto
from typing import Annotated

from pydantic import computed_field

from dbbstation.facts.serialise import Kept

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
