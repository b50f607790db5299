"""What results of every comparison share: numbers with their uncertainty, gains in held-out parts, and what is left."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.results.serialise import Quantified

if TYPE_CHECKING:
    from dbbstation.inference.cancelling import Cancelling
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.read_off import Span
    from dbbstation.inference.verdict import Gains, Value


@dataclass(frozen=True)
class HeldOutGains:
    """What a cause gains in parts that did not choose it.

    Attributes:
        parts: gain of each part.
        with_gain: parts that gain.
        total: of all.
        predicts: whether that counts as a prediction.
    """

    parts: tuple[float, ...]
    with_gain: int
    total: float
    predicts: bool

    @property
    def counted(self) -> str:
        """In how many parts of how many it gains, as tables print it."""
        return f"{self.with_gain} of {len(self.parts)}"


@dataclass(frozen=True)
class CancellingResult:
    """Effects that are each larger than all together.

    Attributes:
        rms: of each about its mean, by name.
        rms_of_sum: of all together.
        unit: of both.
    """

    rms: Mapping[str, float]
    rms_of_sum: float
    unit: str


@dataclass(frozen=True)
class EffectSpan:
    """Where an effect is large.

    Attributes:
        variable: that it follows.
        low: from this value of it.
        high: to this value.
        unit: of both.
    """

    variable: str
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class ResidualTestResult:
    """One test of whether something is left.

    Attributes:
        name: `sum of squares`, `wave in time`, `runs of sign`, `blocks`, or a variable.
        probability: that noise alone leaves as much.
        rms: of what is out, beyond noise, in the unit of the residual.
        where: place, in words; empty where it has none.
    """

    name: str
    probability: float
    rms: float
    where: str


@dataclass(frozen=True)
class ResidualResult:
    """Whether something is left beyond noise.

    Attributes:
        is_noise: whether nothing is.
        probability: that noise alone leaves as much in any test.
        looks: the tests.
    """

    is_noise: bool
    probability: float
    looks: tuple[ResidualTestResult, ...]

    @property
    def worst(self) -> ResidualTestResult:
        """The test that is least probable by chance."""
        return min(self.looks, key=lambda one: one.probability)


def finite(number: float | None) -> float | None:
    """Return a number, or None where it is not finite: JSON has no word for that."""
    return number if number is not None and math.isfinite(number) else None


def quantified(value: Value) -> Quantified:
    """Return a number with its standard uncertainty, None where that is not known."""
    return Quantified(value.value, finite(value.uncertainty), value.unit)


def all_quantified(values: Mapping[str, Value]) -> dict[str, Quantified]:
    """Return numbers by name, each with its standard uncertainty."""
    return {name: quantified(value) for name, value in values.items()}


def gains_result(gains: Gains | None) -> HeldOutGains | None:
    """Return gains in held-out parts; None where these were not asked for."""
    return None if gains is None else HeldOutGains(gains.parts, gains.with_gain, gains.total, gains.predicts)


def cancelling_result(found: Cancelling | None, unit: str, scale: float = 1.0) -> CancellingResult | None:
    """Return effects that cancel each other; None where none do.

    Args:
        found: the effects, in the unit of the residual.
        unit: that they are given in.
        scale: this many of it are one of the residual's.
    """
    if found is None:
        return None
    return CancellingResult({name: scale * rms for name, rms in found.rms.items()}, scale * found.rms_of_sum, unit)


def span_result(span: Span) -> EffectSpan:
    """Return where an effect is large."""
    return EffectSpan(span.variable, span.low, span.high, span.unit)


def residual_result(left: LeftOver) -> ResidualResult:
    """Return what is left, by each test."""
    tests = (ResidualTestResult(one.name, one.probability, one.rms, one.where) for one in left.looks)
    return ResidualResult(left.is_noise, left.probability, tuple(tests))
