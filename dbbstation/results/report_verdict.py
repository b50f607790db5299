"""The ranked causes and the verdict of a report, with reasons and advice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.facts.digits import expanded_uncertainty, with_uncertainty
from dbbstation.facts.held import ReportVerdict
from dbbstation.quality.conformity import Conformity
from dbbstation.results.model_warnings import lacks_physics
from dbbstation.results.words import evaluated_sentence

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.diagnosis.effects import CauseEffect
    from dbbstation.facts.held import HeldTolerance
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.results.calibration import EvaluationResult
    from dbbstation.results.circles import Circled, MeasuredCircle


@dataclass(frozen=True, eq=False)
class Ranked:
    """Causes shown with the circles.

    Attributes:
        why_not: reason if there are no causes; else empty.
        said: the model's diagnosis in two sentences; may be empty.
        picture: the diagnosis's errors in held-out tests as lines of a picture; may be empty.
    """

    session: str = ""
    effects: tuple[CauseEffect, ...] = ()
    why_not: str = ""
    said: tuple[str, ...] = ()
    picture: tuple[str, ...] = ()


def told_causes(ranked: Ranked, coverage_factor: float) -> tuple[str, ...]:
    """Return a sentence for each cause with its cure, in order of contribution."""
    told = []
    for rank, one in enumerate(ranked.effects, start=1):
        g, g_u = with_uncertainty(one.g_um, expanded_uncertainty(one.g_u_um, coverage_factor))
        centre, _ = with_uncertainty(one.centre_um, expanded_uncertainty(one.centre_u_um, coverage_factor))
        known = "" if g_u == "-" else f", U {g_u} µm"
        told.append(
            f"Cause {rank}, {one.cause}: {g} µm of G{known}, {centre} µm of the centres. {one.cure[0].upper()}{one.cure[1:].rstrip('.')}."
        )
    return tuple(told)


MOST_TOLD = 5
"""Greatest number of runs on the first page; the findings name all."""


def verdict_of(
    held: Sequence[HeldTolerance],
    found: Circled,
    coverage_factor: float,
    identified: IdentifiedModel | None = None,
    ranked: Ranked | None = None,
    evaluation: EvaluationResult | None = None,
) -> ReportVerdict:
    """Return the verdict on measured circles by their tolerances."""
    said = {one.conformity for one in held}
    repeat = (*_to_repeat(found.circles), *_of_the_model(found, identified, evaluation))
    if not said - {None}:
        nothing = "The shop's settings have no tolerance for these circles: there is no verdict."
        write = "Write tolerances into the shop's settings (`dbbstation settings --template` shows how) and make the report anew."
        return ReportVerdict("none", nothing, (), (*repeat, write))
    told = [one for one in held if one.conformity in {Conformity.EXCEEDED, Conformity.UNDECIDED}]
    reasons = tuple(_reason(one) for one in told)
    causes = () if ranked is None else told_causes(ranked, coverage_factor)[:MOST_TOLD]
    if Conformity.EXCEEDED in said:
        headline = "The machine is NOT within the shop's tolerances."
        return ReportVerdict(Conformity.EXCEEDED, headline, reasons, (*repeat, *causes, *_cure(found, identified)))
    if Conformity.UNDECIDED in said:
        headline = "It cannot be told whether the machine is within the shop's tolerances."
        narrow = (
            "A limit lies within the uncertainty U of a figure, or the figure has none. The budget of the figure says what U comes from "
            "(`dbbstation circles --budget`): lessen its largest term, state what the session lacks, or agree on another limit."
        )
        return ReportVerdict(Conformity.UNDECIDED, headline, reasons, (*repeat, *causes, narrow))
    keep = (
        "The circles need no correction. Measure again after a crash, a repair or a move of the machine; the plan "
        "ten-minute-check.yaml shows in three tests whether this still holds."
    )
    return ReportVerdict(Conformity.WITHIN, "Every circle is within the shop's tolerances.", (), (*repeat, keep))


def _reason(held: HeldTolerance) -> str:
    worst = held.worst
    if worst is None:
        return ""
    name = held.quantity.replace("-", " ").capitalize()
    run = f"{worst.test} {worst.direction} {worst.repeat}"
    exceeded = f"{held.exceeded} of {held.circles} circles exceed it"
    undecided = f"of {held.undecided} it cannot be told" if held.undecided else ""
    counts = ", ".join(part for part in (exceeded, undecided) if part)
    if worst.expanded_um is None:
        return (
            f"{name}: run {run} has {worst.um:.1f} µm, {worst.why_not}. At most {held.largest_um:g} µm is allowed. "
            f"{counts}."
        )
    shown, expanded = with_uncertainty(worst.um, worst.expanded_um)
    measured = f"{shown} µm, U {expanded} µm"
    return f"{name}: run {run} has {measured}; at most {held.largest_um:g} µm. {counts}."


def _to_repeat(circles: Iterable[MeasuredCircle]) -> list[str]:
    told = []
    for one in circles:
        wrong = () if one.judgement is None else one.judgement.wrong
        texts = [one.problem] if one.problem else [finding.text for finding in wrong]
        if texts:
            told.append(f"Look at run {one.entry.label} of {one.session}, and measure it again: {'; '.join(texts)}.")
    more = len(told) - MOST_TOLD
    return [*told[:MOST_TOLD], *([f"{more} more runs have findings: see Findings."] if more > 0 else [])]


def _of_the_model(found: Circled, identified: IdentifiedModel | None, evaluation: EvaluationResult | None) -> list[str]:
    if identified is None or not lacks_physics(identified.report):
        return [] if evaluation is None else [f"{evaluated_sentence(evaluation)}."]
    return [
        (
            f"Do not compensate with this model. Look for what it lacks: `dbbstation diagnose {_names(found)} --out joint.yaml`, and make "
            "the report again with that model."
        )
    ]


def _names(found: Circled) -> str:
    return " ".join(session.name for session in found.sessions)


def _cure(found: Circled, identified: IdentifiedModel | None) -> tuple[str, ...]:
    if identified is not None and lacks_physics(identified.report):
        return ()
    compensated = all(one.entry.program is not None and one.entry.program.model_sha256 for one in found.circles)
    if compensated:
        return (
            (
                "The programs were compensated, and the circles are off all the same: `dbbstation diagnose` looks for what the "
                "model lacks. See that nothing has moved since the model was made."
            ),
        )
    told = (
        ()
        if identified is not None
        else (f"Calibrate the machine: `dbbstation calibrate {_names(found)} --out model.yaml`.",)
    )
    return (
        *told,
        (
            "Write compensated programs with `dbbstation program` and the model, measure them, and make the report again "
            "with `--before` and this session."
        ),
    )
