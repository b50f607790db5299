"""Two sessions side by side, without a model: where they differ, by how much against their noise, and how in order.

A difference is B less A. Its low harmonics are held against what chance puts there: the noise of both recordings, read
from the difference's high harmonics, and the stated scatter of mountings, CMM sheets and bars of both sessions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq
from scipy.stats import f as f_distribution
from scipy.stats import ncx2

from dbbstation.diagnosis.compare_families import families
from dbbstation.diagnosis.compare_noise import Chance, Weighting, chance_of, first_columns, lowest_columns
from dbbstation.diagnosis.compare_organised import Halves, Organised, halves, organise
from dbbstation.diagnosis.compare_pairs import Matching, match
from dbbstation.errors import TraceError
from dbbstation.inference.harmonics import basis
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.compare_families import Family
    from dbbstation.diagnosis.compare_pairs import Pair
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation

SIGNIFICANT = 1e-3
"""Probability below which the sessions, or all runs together, count as different."""

POWER = 0.9
"""Chance with which the smallest difference that is stated would have been found."""

CENTRED_MM = 2e-5
CENTRED_SIGMA = 4.0
"""A circle whose centre lies this close to the commanded one, in every run, had it removed: balls never sit so well."""

CENTRED_SHAPE = 25.0
"""... if what is left of it is this many times the smallest centre that would have been noticed."""


@dataclass(frozen=True, eq=False)
class RunDifference:
    """One run of B less the same run of A.

    Attributes:
        pair: both recordings.
        smooth_mm: difference up to the highest smooth harmonic, at the common angles, shape (s,) [mm].
        rms_mm: of that [mm].
        noise_mm: root mean square that noise alone leaves in it [mm].
        centre_mm: by how much the circle's centre moved, x and y [mm].
        centre_sigma_mm: standard deviation of either by noise, mountings and CMM sheets [mm].
        radial_mm: by how much the mean length changed [mm].
        radial_sigma_mm: standard deviation of that by noise, bars, and mountings where the bar is raised [mm].
        circularity_mm: greatest less least of what is left without mean and centre [mm].
        ratio: how many times as large as chance leaves it, every harmonic by its own measure: 1 for none.
        probability: of a difference like this or larger by chance alone.
    """

    pair: Pair
    smooth_mm: NDArray[np.float64]
    rms_mm: float
    noise_mm: float
    centre_mm: tuple[float, float]
    centre_sigma_mm: float
    radial_mm: float
    radial_sigma_mm: float
    circularity_mm: float
    ratio: float
    probability: float

    @property
    def peak(self) -> tuple[float, float]:
        """Angle [deg] and value [mm] of the greatest smooth difference."""
        at = int(np.argmax(np.abs(self.smooth_mm)))
        return float(self.pair.theta_deg[at]), float(self.smooth_mm[at])


@dataclass(frozen=True, eq=False)
class Comparison:
    """Everything found.

    Attributes:
        matching: which runs were put side by side.
        runs: in the order of session A.
        probability: of sessions that differ so much or more by chance alone.
        different: runs that differ, beyond chance, by index.
        rms_mm: of all smooth differences [mm].
        beyond_mm: of these, beyond noise and what is stated [mm].
        noise_mm: root mean square that noise leaves in the smooth differences [mm].
        smallest_mm: smooth difference of one run that would have been found nine times in ten, root mean square [mm].
        halves: what both directions share, and what changes its sign; None where no test was run in both.
        organised: variables that order the differences, best first; empty where there are no differences.
        taken: the first of them, then what orders the rest beside it, and so on; empty where none is beyond chance.
    """

    matching: Matching
    runs: tuple[RunDifference, ...]
    probability: float
    different: tuple[int, ...]
    rms_mm: float
    beyond_mm: float
    noise_mm: float
    smallest_mm: float
    halves: Halves | None
    organised: tuple[Organised, ...]
    taken: tuple[Organised, ...]

    @property
    def differ(self) -> bool:
        """Whether the sessions differ beyond chance."""
        return self.probability < SIGNIFICANT


def compare(machine: Machine, a: Sequence[Observation], b: Sequence[Observation]) -> Comparison:
    """Compare two sessions.

    Args:
        machine: nominal, for the way from struts to readings.
        a: accepted runs of session A.
        b: accepted runs of session B.

    Raises:
        TraceError: no run in common; circles of one of them had their centres removed.
    """
    for name, session in (("A", a), ("B", b)):
        _refuse_centred(name, session)
    matching = match(a, b)
    chance = chance_of(matching.pairs)
    weighting = Weighting.of(chance.low, chance.noise, chance.stated)
    together = float(np.sum(weighting.whitened(chance.coefficients[:, :, None]) ** 2))
    count = chance.coefficients.size
    joint = float(f_distribution.sf(together / count, count, chance.freedom))
    runs = tuple(_run(pair, chance, r) for r, pair in enumerate(matching.pairs))
    every = families(machine, matching.pairs, chance.low)
    found = organise(matching.pairs, chance, every)
    # Three looks at the same numbers: all runs together, the worst run, the best order among them.
    worst = _least([run.probability for run in runs])
    probability = _least([joint, worst, min(one.probability for one in found)])
    differ = probability < SIGNIFICANT
    squares = chance.coefficients**2
    samples = len(runs) * len(runs[0].smooth_mm)
    return Comparison(
        matching=matching,
        runs=runs,
        probability=probability,
        different=tuple(r for r, run in enumerate(runs) if run.probability < SIGNIFICANT / len(runs)),
        rms_mm=float(np.sqrt(squares.sum() / samples)),
        beyond_mm=float(np.sqrt(weighting.beyond(chance.coefficients) / samples)),
        noise_mm=float(np.sqrt(chance.noise.sum() / samples)),
        smallest_mm=_smallest(chance, len(runs[0].smooth_mm)),
        halves=halves(matching.pairs, chance) if differ else None,
        organised=tuple(found) if differ else (),
        taken=tuple(_taken(matching.pairs, chance, every, found)) if differ else (),
    )


MOST_TAKEN = 3
"""Variables that are looked for beside one another."""


SMALLEST_SHARE = 0.01
"""What orders less of a difference is not worth a word."""


def _taken(
    pairs: Sequence[Pair], chance: Chance, every: Sequence[Family], found: Sequence[Organised]
) -> list[Organised]:
    """Grow a set of variables while each brings something beyond chance beside the others."""
    taken: list[Organised] = []
    while len(taken) < MOST_TAKEN:
        candidates = found if not taken else organise(pairs, chance, every, taken)
        best = next((one for one in candidates if one.probability < SIGNIFICANT and one.share > SMALLEST_SHARE), None)
        if best is None:
            break
        taken.append(best)
    return taken


def _run(pair: Pair, chance: Chance, r: int) -> RunDifference:
    row, noise = chance.coefficients[r], chance.noise[r]
    count = len(pair.a_mm)
    weighting = Weighting.of(chance.low, chance.noise[r : r + 1], chance.stated[r : r + 1])
    white = weighting.whitened(row[None, :, None])[:, 0] ** 2
    # Changes of a machine are mostly in the lowest harmonics, where the others' noise should not drown them.
    looks = [white, white[lowest_columns(chance.low)]]
    chances = [float(f_distribution.sf(float(one.mean()), len(one), chance.run_freedom)) for one in looks]
    columns = basis(np.radians(pair.theta_deg), chance.low) / np.sqrt(count)
    shape = row.copy()
    zero, cosine, sine = first_columns(chance.low)
    shape[[zero, cosine, sine]] = 0.0
    # Of a raised bar the radius on the level is seen along the bar: less by the cosine of its elevation.
    per_mm = np.sqrt(count / 2.0) * float(np.cos(np.radians(pair.circle.elevation_deg)))
    variance = noise + chance.stated_variance[r]
    return RunDifference(
        pair=pair,
        smooth_mm=np.asarray(columns @ row, dtype=np.float64),
        rms_mm=float(np.sqrt(row @ row / count)),
        noise_mm=float(np.sqrt(noise.sum() / count)),
        centre_mm=(float(row[cosine] / per_mm), float(row[sine] / per_mm)),
        centre_sigma_mm=float(np.sqrt(variance[cosine]) / per_mm),
        radial_mm=float(row[zero] / np.sqrt(count)),
        radial_sigma_mm=float(np.sqrt(variance[zero] / count)),
        circularity_mm=float(np.ptp(columns @ shape)),
        ratio=float(np.sqrt(white.mean())),
        probability=_least(chances),
    )


def _least(probabilities: Sequence[float]) -> float:
    """Probability that the least of so many independent ones comes out as small [Šidák 1967]."""
    return float(-np.expm1(len(probabilities) * np.log1p(-min(*probabilities, 1.0 - 1e-16))))


def _smallest(chance: Chance, count: int) -> float:
    """Root mean square of a smooth difference of the usual run that would count as one, with the power stated [mm]."""
    freedom = float(chance.coefficients.shape[1])
    limit = freedom * float(f_distribution.isf(SIGNIFICANT / len(chance.noise), freedom, chance.run_freedom))
    needed = float(brentq(lambda size: ncx2.sf(limit, freedom, size) - POWER, 1e-6, 1e4))
    return float(np.sqrt(needed * np.median(chance.noise[:, chance.harmonic > 1].mean(axis=1)) / count))


def _refuse_centred(name: str, runs: Sequence[Observation]) -> None:
    """Refuse a session whose every circle lies on its commanded centre, though it is no circle."""
    if len(runs) < 2:  # noqa: PLR2004 - one centre may be where it belongs
        return
    for run in runs:
        found = figures(run.raw)
        rough = np.diff(run.raw.length_mm, 2) / np.sqrt(6.0)  # noise alone: second differences of what is smooth vanish
        limit = max(CENTRED_SIGMA * float(np.sqrt(2.0 * np.mean(rough**2) / len(run.raw))), CENTRED_MM)
        if 1e-3 * found.centre_deviation_um > limit or 1e-3 * found.circularity_um < CENTRED_SHAPE * limit:
            return
    raise TraceError(
        f"in session {name} all circles lie on their commanded centres within noise: their centres were removed",
        remedy="compare raw bar lengths; a circle without its centre does not say where it was",
    )
