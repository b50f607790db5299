"""Faults common to all runs: programs mirrored, turned or reversed, and another bar.

Such a session agrees with itself, but mirrored forms of several tests fit no hexapod, and a uniformly oversized machine
errs in other ways too. Ways to have run the session are compared by likelihood. Sound runs favour another way by f or
more with a chance of at most 1 / f [Markov's inequality].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.quality.finding import Finding, FindingVerdict, Name, undecided
from dbbstation.quality.forms import SIZES, by_place, stacked
from dbbstation.quality.knowledge import COEFFICIENTS, HIGHEST_HARMONIC
from dbbstation.quality.limits import length_quantile
from dbbstation.quality.together import expected_um, read_um

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.plan.circle import Circle
    from dbbstation.quality.knowledge import Seen

PROBABILITY = 1e-6
"""Probability that sound runs favour any other way so much: too small to count among what all findings share. Eight tests that were run
otherwise favour it by e^70 and more, and by a bar of 50 µm more by e^60."""

FEWEST_TESTS = 2
"""Tests that must be there where no model says what the machine is like: any form of one circle, mirrored or turned, is that of some machine."""

BAR_UM = 1e3
"""Standard deviation of what another bar is longer by, a millimetre: one that is longer by the feed-in, usually 1.5 mm, shows no circle. Ten times as
much takes 2.3 from the logarithm of the ratio."""


@dataclass(frozen=True)
class Way:
    """A way in which all programs may have run.

    Attributes:
        label: in the shop's words.
        reverses: whether the machine turned against its programs.
        begin_deg: angle from +X where a circle began instead of a given one.
    """

    label: str
    reverses: bool
    begin_deg: Callable[[float], float]


WAYS = (
    Way("the wrong way round (G2 and G3 exchanged)", reverses=True, begin_deg=lambda start: start),
    Way("mirrored in X", reverses=True, begin_deg=lambda start: 180.0 - start),
    Way("mirrored in Y", reverses=True, begin_deg=lambda start: -start),
    Way("with X and Y exchanged", reverses=True, begin_deg=lambda start: 90.0 - start),
    Way("with X and -Y exchanged", reverses=True, begin_deg=lambda start: 270.0 - start),
    Way("in axes turned by 90 degrees", reverses=False, begin_deg=lambda start: start + 90.0),
    Way("in axes turned by 180 degrees", reverses=False, begin_deg=lambda start: start + 180.0),
    Way("in axes turned by 270 degrees", reverses=False, begin_deg=lambda start: start + 270.0),
)
"""All ways to turn and mirror a plane that leave its axes along its axes, and the other sense of rotation."""

PLANNED = Way("as planned", reverses=False, begin_deg=lambda start: start)
KEEPING, REVERSING = (tuple(way for way in WAYS if way.reverses is reverses) for reverses in (False, True))


def programs_of_all(runs: Sequence[Seen]) -> Finding:
    """Test whether programs ran in another way than planned.

    Args:
        runs: all that count; used are those with the other direction on the same mounting, from two tests on.
    """
    pairs = [(one, other) for one in runs if (other := _other_direction(one, runs)) is not None]
    if len({one.run.test for one, _ in pairs}) < FEWEST_TESTS:
        return undecided(Name.PROGRAMS, f"fewer than {FEWEST_TESTS} tests were measured in both directions")
    planned = [one for one, _ in pairs]
    other_way = [_run_as(one, other) for one, other in pairs]
    read = [read_um(one) for one in planned]
    kept, turned = _Likelihood(planned, read, (PLANNED, *KEEPING)), _Likelihood(other_way, read, REVERSING)
    tried = np.concatenate([kept.logarithms[1:], turned.logarithms])
    # No way is likelier than another before.
    value = float(logsumexp(tried) - np.log(len(tried)) - kept.logarithms[0])
    best = int(np.argmax(tried))
    way = (*KEEPING, *REVERSING)[best]
    limit = -float(np.log(PROBABILITY))
    stated = f"all {len(planned)} runs together"
    if value <= 0.0:
        return Finding(
            Name.PROGRAMS,
            0.0,
            limit,
            "",
            FindingVerdict.GOOD,
            f"{stated} are likelier as planned than mirrored or turned",
        )
    if value <= limit:
        why = f"{stated} are {np.exp(value):.0f} times as likely if programs ran otherwise, best {way.label}: too little to tell"
        return Finding(Name.PROGRAMS, value, limit, "", FindingVerdict.CANNOT_TELL, why)
    likeliest = kept.fits(best + 1) if best < len(KEEPING) else turned.fits(best - len(KEEPING))
    if not likeliest:
        return undecided(Name.PROGRAMS, f"{stated} fit no way in which all programs may have run")
    why = f"{stated} are over a million times as likely if programs ran otherwise, best {way.label}"
    return Finding(Name.PROGRAMS, value, limit, "", FindingVerdict.WRONG, why, f"all programs ran {way.label}")


def bar_of_all(runs: Sequence[Seen], *, by_model: bool) -> Finding:
    """Test whether the bar had another length.

    Without a model, an oversized machine explains the same readings, and it is undecided.

    Args:
        by_model: whether a model says where circles lie.
    """
    known = [one for one in runs if one.run.expected is not None and one.run.bar_stated]
    if not known:
        return undecided(Name.BAR, "no calibrated length of the bar is stated")
    fewest = 1 if by_model else FEWEST_TESTS
    if len({one.run.test for one in known}) < fewest:
        return undecided(Name.BAR, f"fewer than {fewest} tests were measured")
    as_stated = _Likelihood(known, [read_um(one) for one in known], (PLANNED,), longer=True)
    ratio, by_um = as_stated.gained(BAR_UM)
    limit = -float(np.log(PROBABILITY))
    if ratio > limit and not as_stated.fits(0, by_um):
        return undecided(Name.BAR, "all runs together fit no bar of another length either")
    stated = f"the bar reads {abs(by_um):.0f} µm too {'long' if by_um > 0.0 else 'short'} in all runs"
    if ratio <= limit:
        sound = "all runs together do not ask for a bar of another length"
        return Finding(Name.BAR, max(ratio, 0.0), limit, "", FindingVerdict.GOOD, sound)
    if by_model:
        return Finding(Name.BAR, ratio, limit, "", FindingVerdict.WRONG, f"{stated}, by the model", stated)
    why = f"{stated}, or the machine makes all circles {'larger' if by_um > 0.0 else 'smaller'} by as much"
    return Finding(Name.BAR, ratio, limit, "", FindingVerdict.CANNOT_TELL, why, stated)


def _other_direction(one: Seen, runs: Sequence[Seen]) -> Seen | None:
    """Return the other direction of the same test and mounting with known place."""
    if one.run.expected is None:
        return None
    others = (
        other
        for other in runs
        if (other.run.test, other.run.mounting) == (one.run.test, one.run.mounting)
        and other.run.circle.direction is not one.run.circle.direction
        and other.run.expected is not None
    )
    return next(others, None)


def _run_as(one: Seen, other: Seen) -> Seen:
    return replace(one, run=replace(one.run, circle=other.run.circle, expected=other.run.expected))


def _begun(read: NDArray[np.float64], circle: Circle, way: Way) -> NDArray[np.float64]:
    """Return coefficients along the travel if the circle began by a way, shape (7,) [µm]."""
    ahead = np.radians(circle.direction.sign * (way.begin_deg(circle.start_deg) - circle.start_deg))
    angles = ahead * np.arange(1, HIGHEST_HARMONIC + 1)
    mean, cosines, sines = np.split(read, [1, HIGHEST_HARMONIC + 1])
    turned = (cosines * np.cos(angles) - sines * np.sin(angles), cosines * np.sin(angles) + sines * np.cos(angles))
    return np.concatenate([mean, *turned])


class _Likelihood:
    """Likelihood of readings by ways, for any size of machine errors.

    Args:
        read: along the plan's travel, shape (7,) each [µm].
        longer: include readings of a longer bar.

    Attributes:
        logarithms: by way, shape (k,).
    """

    def __init__(
        self, runs: Sequence[Seen], read: Sequence[NDArray[np.float64]], ways: Sequence[Way], *, longer: bool = False
    ) -> None:
        bar = np.eye(COEFFICIENTS)[:, :1] if longer else np.zeros((COEFFICIENTS, 0))
        off = [
            np.column_stack([*(_begun(each, one.run.circle, way) - expected_um(one.run) for way in ways), bar])
            for one, each in zip(runs, read, strict=True)
        ]
        self._dimensions = COEFFICIENTS * len(runs)
        self._few = stacked(by_place(runs, off)).apart()
        self._by_size = self._few.log_likelihoods()
        self.logarithms = logsumexp(self._by_size[:, : len(ways)], axis=0)

    def fits(self, way: int, longer_um: float = 0.0) -> bool:
        """Return whether readings fit a machine with the known causes.

        Args:
            longer_um: excess of the bar's reading.
        """
        off = self._few.off[:, way] - (longer_um * self._few.off[:, -1] if longer_um else 0.0)
        distances = [float(np.sum(off**2 / self._few.variances(float(size)))) for size in SIZES]
        unlikeliness = [
            distance + float(np.sum(np.log(self._few.variances(float(size)))))
            for distance, size in zip(distances, SIZES, strict=True)
        ]
        return distances[int(np.argmin(unlikeliness))] <= length_quantile(self._dimensions) ** 2

    def gained(self, sigma_um: float) -> tuple[float, float]:
        """Return the log gain of a longer bar, and its excess [µm]."""
        off, column = self._few.off.T
        logarithms, amounts = [], []
        for size in SIZES:
            pulled = column / self._few.variances(float(size))
            # Matrix determinant lemma, and the conditional mean of one normal amount [Rasmussen and Williams, eq. A.9, A.10].
            weight = float(column @ pulled) + sigma_um**-2
            amount = float(pulled @ off) / weight
            logarithms.append(0.5 * (amount**2 * weight - float(np.log(weight * sigma_um**2))))
            amounts.append(amount)
        joint = self._by_size[:, 0] + np.array(logarithms)
        amount = float(np.exp(joint - logsumexp(joint)) @ np.array(amounts))
        return float(logsumexp(joint) - self.logarithms[0]), amount
