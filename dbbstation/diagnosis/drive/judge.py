"""Verdicts on the causes of force, and what can be said where none of them is it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import f as f_distribution

from dbbstation.diagnosis.drive.design import BASE
from dbbstation.diagnosis.drive.findings import DriveFinding, Rest
from dbbstation.diagnosis.drive.fit import fit, term_of
from dbbstation.diagnosis.drive.limits import TESTABLE_SIGMA
from dbbstation.diagnosis.findings import Value, Verdict
from dbbstation.inference.concealment import concealment
from dbbstation.inference.race import AS_GOOD, worth_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.drive.contract import DriveSource
    from dbbstation.diagnosis.drive.design import Design
    from dbbstation.diagnosis.drive.fit import DriveFit
    from dbbstation.inference.race import Candidate, Choice, Race, Variant

SIGNIFICANT = 1e-3
"""Probability below which a misfit counts as one."""

SHAPE_THRESHOLD = 10.0
"""Log evidence that an unnamed shape must bring."""

METHOD_SHARE = 0.002
"""Of the force's root mean square: low-pass and differences leave up to this of a drive that follows its model exactly,
mostly beside stops. Less than it is no misfit, however well it stands out of the noise."""

NAMED_EXPLAINS = 0.9
"""Share of what the best unnamed shape explains that names must explain to be believed: below it they are only the nearest
names of something else."""

TESTABLE_SHARE = 0.5
"""Share of the combinations of a name's amplitudes that must be seen for the name to be ruled out."""

OF_ITS_OWN = 0.5
"""Share that a name must explain beside an unnamed shape, of what it explains without it or of what the shape leaves."""

MINOR = 0.05
"""Share of what all names explain below which a name is small."""

OUTWEIGHS = 3.0
"""A name must explain so many times what is left without one to stand out of it: an unknown law leaves crumbs that fit
many names."""


def by_chance(design: Design, square: float, used: int) -> tuple[float, float]:
    """Probability that noise alone leaves so much, and the root mean square beyond noise [N].

    Args:
        design: whose names and shapes together say what noise is.
        square: sum of squares that a model leaves [N²].
        used: its parameters.
    """
    freedom = design.freedom - used
    beyond = square - design.noise_square
    if freedom <= 0 or beyond <= 0.0:
        return 1.0, 0.0
    count = len(design.force_n)
    left = max((count - design.freedom) / design.noise.correlation_samples, 1.0)
    ratio = beyond / freedom / design.noise_n**2
    rms = float(np.sqrt(max(beyond - freedom * design.noise_n**2, 0.0) / count))
    if rms < METHOD_SHARE * design.signals.scale.force_n:
        return 1.0, 0.0
    return float(f_distribution.sf(ratio, freedom, left)), rms


def share_of_force(design: Design, race: Race, chosen: Sequence[Choice], one: Choice) -> float:
    """Root mean square of what a name explains beside the others, over that of the force."""
    others = [choice.variant for choice in chosen if choice is not one]
    alone = race.explained([c.variant for c in chosen]) - (race.explained(others) if others else 0.0)
    rms = design.noise_n * np.sqrt(max(alone, 0.0) / len(design.force_n))
    return float(rms) / design.signals.scale.force_n


def judge(design: Design, race: Race, chosen: Sequence[Choice], after: DriveFit) -> tuple[DriveFinding, ...]:
    """One finding per cause, best first.

    Args:
        design: the recording.
        race: on what the base leaves.
        chosen: causes that were found.
        after: joint fit.
    """
    blocks, fitted, candidates = design.blocks(design.columns), np.arange(len(BASE)), design.named
    rest, on_joint, _ = design.race(after.columns)
    names = [choice.candidate.name for choice in chosen]
    likes = _likenesses(design, race, chosen)
    findings = []
    for candidate, beside in zip(candidates, on_joint, strict=True):
        alike = likes.get(candidate.name, ())
        if candidate.name in names:
            own = next(choice for choice in chosen if choice.candidate.name == candidate.name)
            gain, variant = worth_of(race, chosen, own), own.variant
            size = after.values[after.amplitudes(candidate.name)]
            values = after.parameters(candidate.name)
            verdict = Verdict.AMBIGUOUS if alike else Verdict.IDENTIFIED
        else:
            best, gain = rest.best_variant(beside, [])
            values = _best_values(design, rest, beside, best)
            seen = float(np.mean(rest.visible(best) >= TESTABLE_SIGMA))
            verdict = Verdict.RULED_OUT if seen >= TESTABLE_SHARE else Verdict.NOT_TESTABLE
            verdict = Verdict.AMBIGUOUS if alike else verdict
            variant, _ = race.best_variant(candidate, [])
            size = variant.prior
        signature = concealment(blocks, fitted, variant.columns, size)
        findings.append(
            DriveFinding(
                name=candidate.name,
                verdict=verdict,
                ambiguous_with=alike,
                gain=gain,
                concealed=signature.share,
                whole_n=signature.whole_rms,
                rest_n=signature.rest_rms,
                parameters=values,
                text=_text(design.sources[candidate.name], verdict, alike),
            )
        )
    order = [Verdict.IDENTIFIED, Verdict.AMBIGUOUS, Verdict.NOT_TESTABLE, Verdict.RULED_OUT]
    return tuple(sorted(findings, key=lambda f: (order.index(f.verdict), -f.gain)))


def _likenesses(design: Design, race: Race, chosen: Sequence[Choice]) -> dict[str, tuple[str, ...]]:
    """Causes that would do about as well in the place of a chosen one, with values that can be, both ways round."""
    likes: dict[str, list[str]] = {}
    names = {choice.candidate.name for choice in chosen}
    for choice in chosen:
        others = [c.variant for c in chosen if c is not choice]
        _, own = race.best_variant(choice.candidate, others)
        for rival in design.named:
            if rival.name in names:
                continue
            variant, theirs = race.best_variant(rival, others)
            if own - theirs >= AS_GOOD:
                continue
            terms = [term_of(design, c.candidate, c.variant) for c in chosen if c is not choice]
            swapped = fit(design, [*terms, term_of(design, rival, variant)])
            if design.sources[rival.name].possible(swapped.all_values()):
                likes.setdefault(choice.candidate.name, []).append(rival.name)
                likes.setdefault(rival.name, []).append(choice.candidate.name)
    return {name: tuple(sorted(alike)) for name, alike in likes.items()}


def _best_values(design: Design, race: Race, candidate: Candidate, variant: Variant) -> dict[str, Value]:
    """Best amplitudes of a cause that was not chosen, in its best form."""
    form = term_of(design, candidate, variant).form
    found = race.amplitudes([variant])
    sigma = np.sqrt(np.diag(found.covariance))
    return {p.name: Value(float(found.values[k]), float(sigma[k]), p.unit) for k, p in enumerate(form.amplitudes)}


def _text(source: DriveSource, verdict: Verdict, alike: Sequence[str]) -> str:
    if verdict is Verdict.IDENTIFIED:
        return f"{source.texts.what} {source.texts.confirm}"
    if verdict is Verdict.AMBIGUOUS:
        return f"This recording cannot tell it from {', '.join(alike)}. {source.texts.confirm}"
    if verdict is Verdict.NOT_TESTABLE:
        return "This recording would not show it at its plausible size: the fitted parameters conceal it."
    return "It would have been seen at its plausible size and was not needed."


def overruled(race: Race, shapes: Sequence[Candidate], chosen: Sequence[Choice]) -> set[str]:
    """Names that are only the nearest ones of a force without a name.

    Where one unnamed shape explains clearly more than all names, those go that it can replace.
    """
    if not chosen:
        return set()
    named = [choice.variant for choice in chosen]
    _, shape, gain = _best(race, shapes)
    if gain < SHAPE_THRESHOLD or race.explained(named) >= NAMED_EXPLAINS * race.explained([shape]):
        return set()
    return {one.candidate.name for one in chosen if _worth(race, chosen, one, shape)[1]}


def _worth(race: Race, chosen: Sequence[Choice], one: Choice, shape: Variant) -> tuple[float, bool]:
    """What a name explains beside the others, and whether a shape can replace it.

    It cannot where the name explains something else than the shape, nor where the name explains most of what the shape
    leaves: a curve over time that follows slow strokes must not take Coulomb friction's place.
    """
    named = [choice.variant for choice in chosen]
    others = [choice.variant for choice in chosen if choice is not one]
    alone = race.explained(named) - (race.explained(others) if others else 0.0)
    beside = race.explained([*named, shape]) - race.explained([*others, shape])
    left = race.chi2 - race.explained([shape])
    return alone, beside < OF_ITS_OWN * min(alone, left)


def rest_of(design: Design, fitted: DriveFit) -> Rest:
    """What is left of the force without a name."""
    probability, rms = by_chance(design, fitted.square, fitted.columns.shape[1])
    if probability >= SIGNIFICANT:
        return Rest(rms, probability, None, 0.0, "Nothing is left beyond noise.")
    race, _, shapes = design.race(fitted.columns)
    candidate, _, gain = _best(race, shapes)
    if gain < SHAPE_THRESHOLD:
        text = "Something is left beyond noise, and no variable organises it clearly."
        return Rest(rms, probability, None, gain, text)
    text = f"A force without a known name, organised by {candidate.name}."
    return Rest(rms, probability, candidate.name, gain, text)


def doubtful(race: Race, shapes: Sequence[Candidate], chosen: Sequence[Choice], rest: Rest) -> set[str]:
    """Names that may only make up for another law: about as much is left as they explain.

    That counts against a name that is small among the names, or that would explain little beside what is left.

    Args:
        race: on what the base leaves.
        shapes: unnamed, numbered for that race.
        chosen: causes that were found.
        rest: what is left of the joint fit.
    """
    if rest.variable is None or not chosen:
        return set()
    shape = next(candidate.variants[0] for candidate in shapes if candidate.name == rest.variable)
    named = [choice.variant for choice in chosen]
    whole = race.explained(named)
    left = race.explained([*named, shape]) - whole
    found = set()
    for one in chosen:
        alone, replaceable = _worth(race, chosen, one, shape)
        if alone < OUTWEIGHS * left and (alone < MINOR * whole or replaceable):
            found.add(one.candidate.name)
    return found


def _best(race: Race, shapes: Sequence[Candidate]) -> tuple[Candidate, Variant, float]:
    """Unnamed shape of the greatest evidence."""
    trials = [(candidate, *race.best_variant(candidate, [])) for candidate in shapes]
    return max(trials, key=lambda trial: trial[2])
