"""What can be said of what is left where no source explains it, and whether names have to give way to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from scipy.special import chdtrc

from dbbstation.diagnosis.findings import SourceFinding, Unexplained, Verdict
from dbbstation.diagnosis.unexplained_curve import curve_of
from dbbstation.diagnosis.unnamed import unnamed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit import Calibration
    from dbbstation.diagnosis.unnamed import Best, Unnamed
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.inference.race import Choice, Race, Variant

NAMED_EXPLAINS = 0.9
"""Share of what the best unnamed shape explains that named sources must explain to be believed: below it they are
only the nearest names of something else."""

FLEXIBLE = 16
"""Amplitudes from which on a source may imitate what it is not: joints that may be off, or run out, everywhere."""

MADE_UP_FOR = 0.2
"""Share of its evidence below which what others bring beside a flexible source only makes up for its failings."""

AS_MUCH, ABOUT_AS_MUCH = 0.95, 0.9
"""Shares of its evidence from which on an unnamed curve explains as much, alone and where the source needs helpers: of a hose's
pull 0.93 to 0.99, where joints stand in for it; of joints that really are off 0.45 to 0.86."""

CLEARLY_MORE = 1.1
"""Times the evidence of an unnamed curve from which on several names are no patchwork in its place: up to 1.09 where the cause was
on no list."""

NEARLY, LEAVES, ADDS, BY_CHANCE = 0.7, 0.1, 0.25, 2e-3
"""An unnamed shape brings the first share of the names' evidence at least, explains the second of what they explain beside them,
and leaves them the third at most: else there are two causes. That chance lets it explain so much happens as seldom as the last; of
26 names that were right it was never less than one in fifty, of two wrong ones 1e-3 and 4e-6."""

SHAPE_THRESHOLD = 8.0
"""Log evidence that an unnamed shape must bring, what picking it from many costs taken off. A misfit of the low harmonics
as a whole is not asked for: a wave or a bump can hide in them. Of forty recordings of the virtual
machine with nothing to find the best brought 5.8, where chance falls by e for each unit more."""

OVERRULES_BY = 5.0
"""Log evidence by which it must be better than names to overrule them, beside explaining more: one that can be bent to
nearly anything explains a little more of any noise."""


@dataclass(frozen=True)
class Rest:
    """What is left without a name, and whether it overrules the names."""

    finding: Unexplained
    overrules: bool

    @property
    def found(self) -> bool:
        """Whether something organises it clearly."""
        return self.finding.variable is not None

    def demoted(self, findings: Sequence[SourceFinding]) -> list[SourceFinding]:
        """Findings with no source identified: the nearest name is not the right one."""
        text = "It explains part of the misfit, but clearly less than the unnamed error does."
        return [
            replace(f, verdict=Verdict.RULED_OUT, ambiguous_with=(), text=text)
            if f.verdict in {Verdict.IDENTIFIED, Verdict.AMBIGUOUS}
            else f
            for f in findings
        ]


def unexplained(
    before: Calibration,
    after: Calibration,
    race: Race,
    first: Misfit,
    left: Misfit,
    chosen: Sequence[Choice],
    *,
    significant: float,
) -> Rest:
    """Look for an unnamed shape in what is left; let it overrule names that explain much less than it does.

    Args:
        before: the base fit.
        after: the joint fit.
        race: of the named sources about the base fit, with the noise that is left in the end.
        first: misfit of the base fit.
        left: misfit of the joint fit.
        chosen: sources that were found.
        significant: probability below which a misfit counts.
    """
    named = [choice.variant for choice in chosen]
    of = unnamed(before, left.noise)
    best = of.best()
    overrules = bool(named) and _overrules(race, named, of, best)
    if named and not overrules:
        beside = unnamed(after, left.noise)
        rival = _rival(race, named, of, beside)
        if rival is None:
            # The names stand; what is left beside them is looked at about the joint fit.
            of, best = beside, beside.best()
        else:
            overrules, best = True, rival
    told = first if overrules else left
    misfit, rms_um = told.probability < significant, 1e3 * told.rms
    if best.gain < SHAPE_THRESHOLD:
        if not misfit:
            return Rest(Unexplained(0.0, None, None, 0.0, "Nothing is left beyond noise."), overrules=False)
        text = "Something is left beyond noise, and no variable organises it clearly."
        return Rest(Unexplained(rms_um, None, None, best.gain, text), overrules=False)
    shape, curve = best.shape, curve_of(of, best)
    where = f"strut {shape.strut}" if shape.strut else "no single strut"
    text = f"An error without a known name, organised by {shape.name}, {where}."
    rms_um = rms_um if misfit else curve.unconcealed_um
    return Rest(Unexplained(rms_um, shape.strut, shape.name, best.gain, text, curve), overrules=overrules)


def overruled(before: Calibration, race: Race, noise_mm: float, named: Sequence[Variant]) -> bool:
    """Whether one unnamed shape explains recordings clearly better than what was chosen with a name.

    Args:
        before: the base fit.
        race: of what has a name about it.
        noise_mm: of one sample [mm].
        named: what was chosen, balls and bars among it.
    """
    of = unnamed(before, noise_mm)
    best = of.best()
    return best.gain >= SHAPE_THRESHOLD and _overrules(race, named, of, best)


def _overrules(race: Race, named: Sequence[Variant], of: Unnamed, best: Best) -> bool:
    """Whether one unnamed shape is clearly better than what has a name.

    The first of the chosen explains most. Where even it falls short of one unnamed curve, the others were only called in
    to make up for that, unless all together bring clearly more: then there are two causes.
    """
    if _imitates(race, named, best):
        return True
    enough = NAMED_EXPLAINS * of.race.explained([best.variant])
    several = race.evidence(named) > CLEARLY_MORE * best.gain
    for some in [named] if several else [named[:1], named]:
        if race.explained(some) < enough and best.gain > race.evidence(some) + OVERRULES_BY:
            return True
    return False


def _rival(race: Race, named: Sequence[Variant], of: Unnamed, beside: Unnamed) -> Best | None:
    """Shape that does nearly as well as what has a name, and that the names leave something to: they are the nearest ones only.

    Beside a name that is right a shape that resembles it explains what chance lets it. What a rough law leaves beside a loud
    cause is little of the whole. Shapes that were picked from many forms explain something of any noise.

    Args:
        race: of the named sources.
        named: what was chosen.
        of: shapes about the base fit.
        beside: the same about the joint fit.
    """
    whole, evidence = race.explained(named), race.evidence(named)
    usual = {(s.name, s.strut): variant for s, variant in beside.shapes if s.tried == 1.0}
    found = []
    for best in of.each:
        variant = usual.get((best.shape.name, best.shape.strut)) if best.shape.tried == 1.0 else None
        if variant is None or best.gain < max(SHAPE_THRESHOLD, NEARLY * evidence):
            continue
        left = beside.race.explained([variant])
        of_the_names = whole + left - of.race.explained([best.variant])  # what they explain beside the shape
        if left > LEAVES * whole and of_the_names < ADDS * whole and chdtrc(len(variant.columns), left) < BY_CHANCE:
            found.append(best)
    return max(found, key=lambda best: best.gain, default=None)


def _imitates(race: Race, named: Sequence[Variant], best: Best) -> bool:
    """Whether a source of many amplitudes only imitates an error that has no name.

    It can follow nearly anything that is smooth in the pose. It has to bring more evidence than an unnamed curve of no
    more amplitudes, clearly. Where such a curve brings about as much, it has to leave nothing that others have to make up for,
    too: what they then bring is little beside it, and all together bring little more than the curve.
    """
    first = named[0]
    if len(first.columns) < FLEXIBLE:
        return False
    alone = race.evidence([first])
    if len(best.variant.columns) <= len(first.columns) and best.gain > AS_MUCH * alone:
        return True
    together = race.evidence(named)
    helped = len(named) > 1 and together - alone < MADE_UP_FOR * alone and together < CLEARLY_MORE * best.gain
    return helped and best.gain > ABOUT_AS_MUCH * alone
