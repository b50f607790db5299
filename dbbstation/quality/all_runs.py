"""Detect faults common to all runs: mirrored, turned or reversed programs, and a wrong bar length.

Such runs agree with each other, but no hexapod has mirrored forms in several tests, and a uniformly oversized machine
has further errors. Likelihoods compare the possible ways of running the programs. Sound runs favour another way by a
factor f or more with a probability of at most 1 / f [Markov's inequality].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.computing.arrays import place_of_largest
from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.forms import Forms, form_of
from dbbstation.quality.limits import length_quantile
from dbbstation.quality.together import expected_um, read_um
from dbbstation.trace.expected import COEFFICIENTS, HIGHEST_HARMONIC

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle
    from dbbstation.quality.forms import FormsBesides, RunForm
    from dbbstation.quality.knowledge import Seen

PROBABILITY = 1e-6
"""Probability that sound runs favour another way so much, negligible in the false alarms of all findings. Eight tests
run another way favour it by e^70 and more; a bar longer by 50 µm is favoured by e^60."""

FEWEST_TESTS = 2
"""Fewest tests without a machine model: any form of one circle, also mirrored or turned, fits some machine."""

BAR_UM = 1e3
"""Prior standard deviation of a wrong bar's length error, a millimetre: a bar longer by the feed-in, usually 1.5 mm,
gives no circle. Ten times as much lowers the log ratio by 2.3."""


@dataclass(frozen=True)
class Way:
    """One way in which the machine may have run all programs.

    Attributes:
        reverses: whether the machine turned against its programs.
        begin_deg: the angle from +X at which a circle began, as a function of the planned angle.
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
"""All rotations and reflections of the plane that map axes to axes, and the reversed sense of rotation."""

PLANNED = Way("as planned", reverses=False, begin_deg=lambda start: start)
KEEPING, REVERSING = (tuple(way for way in WAYS if way.reverses is reverses) for reverses in (False, True))


class AllForms:
    """Forms of all runs of a session.

    Attributes:
        planned: forms under the planned directions: columns for the plan, the ways of KEEPING, and a longer bar.
        turned: forms judged as the other direction of their test: columns for the ways of REVERSING.
    """

    def __init__(self) -> None:
        self.planned, self.turned = Forms(_as_planned), Forms(_as_turned)


def _as_planned(runs: tuple[Seen, ...]) -> RunForm:
    return form_of(runs[0], np.column_stack([_off(runs[0], runs[0], (PLANNED, *KEEPING)), np.eye(COEFFICIENTS)[:, :1]]))


def _as_turned(runs: tuple[Seen, ...]) -> RunForm:
    one, other = runs
    as_other = replace(one, run=replace(one.run, circle=other.run.circle, expected=other.run.expected))
    return form_of(as_other, _off(one, as_other, REVERSING))


def _off(one: Seen, judged_as: Seen, ways: Sequence[Way]) -> Floats:
    """Return a form's difference from expectation, one column per way, shape (7, k) [µm]."""
    read, run = read_um(one), judged_as.run
    return np.column_stack([_begun(read, run.circle, way) - expected_um(run) for way in ways])


def programs_of_all(runs: Sequence[Seen], forms: AllForms | None = None) -> Finding:
    """Judge whether another way of running all programs fits all runs better than the plan.

    Args:
        runs: only runs with the other direction on the same mounting are compared; they must come from two tests.
    """
    pairs = _pairs(runs)
    if len({one.run.test for one, _ in pairs}) < FEWEST_TESTS:
        return undecided(Name.PROGRAMS, f"fewer than {FEWEST_TESTS} tests were measured in both directions")
    forms = forms or AllForms()
    forms.planned.hold(_known(runs))
    forms.turned.hold(pairs)
    dimensions = COEFFICIENTS * len(pairs)
    kept = _Likelihood(forms.planned.part([(one,) for one, _ in pairs]), dimensions)
    turned = _Likelihood(forms.turned.part(pairs), dimensions)
    tried = np.concatenate([kept.logarithms[1 : len(KEEPING) + 1], turned.logarithms])
    # All ways have equal prior probability.
    value = float(logsumexp(tried) - np.log(len(tried)) - kept.logarithms[0])
    best = place_of_largest(tried)
    way = (*KEEPING, *REVERSING)[best]
    limit = -float(np.log(PROBABILITY))
    stated = f"all {len(pairs)} runs together"
    if value <= 0.0:
        return found(Name.PROGRAMS, 0.0, limit, f"{stated} are likelier as planned than mirrored or turned")
    if value <= limit:
        why = f"{stated} are {np.exp(value):.0f} times as likely if programs ran otherwise, best {way.label}: too little to tell"
        return undecided(Name.PROGRAMS, why, value, limit)
    likeliest = kept.fits(best + 1) if best < len(KEEPING) else turned.fits(best - len(KEEPING))
    if not likeliest:
        return undecided(Name.PROGRAMS, f"{stated} fit no way in which all programs may have run")
    why = f"{stated} are over a million times as likely if programs ran otherwise, best {way.label}"
    return found(Name.PROGRAMS, value, limit, "", why, f"all programs ran {way.label}")


def bar_of_all(runs: Sequence[Seen], forms: AllForms | None = None, *, by_model: bool) -> Finding:
    """Judge whether a bar of another length fits all runs better."""
    known = [one for one in runs if one.run.expected is not None and one.run.bar_stated]
    if not known:
        return undecided(Name.BAR, "no calibrated length of the bar is stated")
    fewest = 1 if by_model else FEWEST_TESTS
    if len({one.run.test for one in known}) < fewest:
        return undecided(Name.BAR, f"fewer than {fewest} tests were measured")
    forms = forms or AllForms()
    forms.planned.hold(_known(runs))
    as_stated = _Likelihood(forms.planned.part([(one,) for one in known]), COEFFICIENTS * len(known))
    ratio, by_um = as_stated.gained(BAR_UM)
    limit = -float(np.log(PROBABILITY))
    if ratio > limit and not as_stated.fits(0, by_um):
        return undecided(Name.BAR, "all runs together fit no bar of another length either")
    stated = f"the bar reads {abs(by_um):.0f} µm too {'long' if by_um > 0.0 else 'short'} in all runs"
    if ratio <= limit:
        sound = "all runs together do not ask for a bar of another length"
        return found(Name.BAR, max(ratio, 0.0), limit, sound)
    if by_model:
        return found(Name.BAR, ratio, limit, "", f"{stated}, by the model", stated)
    why = f"{stated}, or the machine makes all circles {'larger' if by_um > 0.0 else 'smaller'} by as much"
    return undecided(Name.BAR, why, ratio, limit, stated)


def _known(runs: Sequence[Seen]) -> list[tuple[Seen]]:
    return [(one,) for one in runs if one.run.expected is not None]


def _pairs(runs: Sequence[Seen]) -> list[tuple[Seen, Seen]]:
    first: dict[tuple[str, str, float], int] = {}
    for k, one in enumerate(runs):
        if one.run.expected is not None:
            first.setdefault((one.run.test, one.run.mounting, one.run.circle.direction.sign), k)
    found: list[tuple[int, int]] = []
    for k, one in enumerate(runs):
        other = first.get((one.run.test, one.run.mounting, -one.run.circle.direction.sign))
        if one.run.expected is not None and other is not None:
            found.append((k, other))
    return [(runs[k], runs[other]) for k, other in sorted(found, key=max)]


def _begun(read: Floats, circle: Circle, way: Way) -> Floats:
    ahead = np.radians(circle.direction.sign * (way.begin_deg(circle.start_deg) - circle.start_deg))
    angles = ahead * np.arange(1, HIGHEST_HARMONIC + 1)
    mean, cosines, sines = np.split(read, [1, HIGHEST_HARMONIC + 1])
    turned = (cosines * np.cos(angles) - sines * np.sin(angles), cosines * np.sin(angles) + sines * np.cos(angles))
    return np.concatenate([mean, *turned])


class _Likelihood:
    """Likelihoods of the readings under the ways, summed over sizes of machine errors.

    Attributes:
        logarithms: by way, shape (k,).
    """

    def __init__(self, part: FormsBesides, dimensions: int) -> None:
        self._part, self._dimensions = part, dimensions
        self._by_size = part.log_likelihoods()
        self.logarithms = logsumexp(self._by_size, axis=0)

    def fits(self, way: int, longer_um: float = 0.0) -> bool:
        """Return whether readings fit a machine with the known causes."""
        white = self._part.white
        off = white[:, :, way] - (longer_um * white[:, :, -1] if longer_um else 0.0)
        distances = np.sum(off**2, axis=1)
        likeliest = int(np.argmin(distances + self._part.log_determinant))
        return float(distances[likeliest]) <= length_quantile(self._dimensions) ** 2

    def gained(self, sigma_um: float) -> tuple[float, float]:
        """Return the log likelihood gain of a longer bar, and its excess length [µm]."""
        off, column = self._part.white[:, :, 0], self._part.white[:, :, -1]
        # Matrix determinant lemma, and the conditional mean of one normal variable [Rasmussen and Williams, eq. A.9,
        # A.10].
        weights = np.sum(column**2, axis=1) + sigma_um**-2
        amounts = np.sum(column * off, axis=1) / weights
        joint = self._by_size[:, 0] + 0.5 * (amounts**2 * weights - np.log(weights * sigma_um**2))
        amount = float(np.exp(joint - logsumexp(joint)) @ amounts)
        return float(logsumexp(joint) - self.logarithms[0]), amount
