"""The result of `compare`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from dbbstation.computing.arrays import median_of, sum_of
from dbbstation.diagnosis.compare.findings import DirectionHalves, LargestEffect, RunDifference
from dbbstation.diagnosis.compare.pairs import NotComparable
from dbbstation.facts import BeforeAfter, of_facts
from dbbstation.facts.value import Value
from dbbstation.inference.alternatives import Cancelling
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.levels import Gains, Levels, Verdict
from dbbstation.inference.read_off import Span
from dbbstation.results.frame import Framed
from dbbstation.results.levels_text import level_sentences

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.compare.comparison import Comparison
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.read_off import CauseFinding


@dataclass(frozen=True)
class VariableSpan(Span):
    """Range of a variable in which a cause is large."""

    low: Annotated[float, Field(serialization_alias="from")]
    high: Annotated[float, Field(serialization_alias="to")]


@dataclass(frozen=True, kw_only=True)
class ComparedCause:
    """Findings on one cause.

    Attributes:
        verdict: see docs/verdicts.md.
        persists: whether other tests confirm a single event.
        recurs: whether other tests predict a wave over time.
        gains: in tests that did not choose it; None if not tested.
        equivalent: causes indistinguishable by these sessions; `class` in JSON.
        taken_up: the effect's share that a new calibration absorbs; None if absent.
        opposite: the effect's share that changes sign with direction; None if absent.
        spans: ranges of variables with a large effect.
    """

    name: str
    form: str
    named: bool
    verdict: str
    acts: str
    persists: bool
    recurs: bool
    gains: Gains | None
    probability: float
    log_evidence: float
    ambiguous_with: tuple[str, ...]
    equivalent: Annotated[tuple[str, ...], Field(serialization_alias="class")]
    rms_um: float | None = None
    share: float | None = None
    taken_up: float | None = None
    opposite: float | None = None
    where: LargestEffect | None = None
    spans: tuple[VariableSpan, ...]
    parameters: Mapping[str, Value]
    text: str


@dataclass(frozen=True)
class CauseNotAsked:
    """A cause that was not tested, because it needs missing data."""

    name: str
    form: str
    named: bool
    verdict: str
    text: str


@dataclass(frozen=True)
class ComparisonResidual:
    """The residual beyond all findings, with its probability by noise alone."""

    beyond_noise: bool
    probability: float
    text: str


@dataclass(frozen=True, kw_only=True)
class ComparisonResult(Framed):
    """Differences of two sessions, B minus A.

    Attributes:
        held_out_worse: whether predictions get worse; None if not tested.
        held_out_rms_um: errors of held-out tests.
        unlike: other differences of the sessions; `notes` in JSON.
        levels: existence, variables and cause of a difference.
    """

    a: str
    b: str
    text: str
    differ: bool
    probability_of_difference: float
    runs_compared: int
    runs_different: int
    difference_rms_um: float
    beyond_chance_rms_um: float
    noise_rms_um: float
    strut_change_noticed_um: float
    held_out: str
    held_out_worse: bool | None
    held_out_rms_um: BeforeAfter
    runs: tuple[RunDifference, ...]
    directions: DirectionHalves | None
    cancelling: Cancelling | None
    organised_text: str
    causes: tuple[ComparedCause | CauseNotAsked, ...]
    left: ComparisonResidual
    only_in_a: tuple[str, ...]
    only_in_b: tuple[str, ...]
    not_comparable: tuple[NotComparable, ...]
    averaged: tuple[str, ...]
    unlike: Annotated[tuple[str, ...], Field(serialization_alias="notes")]
    levels: Levels
    _table_of = "runs", "test, direction, differs, found_rms_um, rms_um, noise_rms_um, peak_um, peak_theta_deg"

    def sentences(self) -> list[str]:
        """Return the answer in three levels, in words."""
        values = {one.name: one.parameters for one in self.causes if isinstance(one, ComparedCause)}
        return level_sentences(self.levels, "µm", values, rows="tests", what="The sessions")

    def headline(self) -> str:
        """Return whether the sessions differ."""
        return self.text


def comparison_result(
    found: Comparison,
    unlike: Sequence[str] = (),
    *,
    a: str = "A",
    b: str = "B",
    drawing: Callable[[object], bytes] | None = None,
    notes: tuple[str, ...] = (),
) -> ComparisonResult:
    """Return the result of a comparison; lengths in µm, largest runs first."""
    largest_first = sorted(found.runs, key=lambda run: (-run.differs, -sum_of(run.found_mm**2), -run.rms_um))
    pairs, gains = found.matching, found.gains
    before, after = found.held_out
    return of_facts(
        ComparisonResult,
        found,
        pairs,
        a=a,
        b=b,
        text=verdict_text(found),
        probability_of_difference=found.probability,
        runs_compared=len(found.runs),
        runs_different=sum(run.differs for run in found.runs),
        difference_rms_um=1e3 * found.rms_mm,
        beyond_chance_rms_um=1e3 * found.found_rms_mm,
        noise_rms_um=found.runs[0].noise_rms_um,
        strut_change_noticed_um=1e3 * found.noticed_mm,
        held_out="not-tested" if gains is None else "tested",
        held_out_worse=None if gains is None else gains.is_worse,
        held_out_rms_um=BeforeAfter(1e3 * before.rms, 1e3 * after.rms),
        runs=tuple(largest_first),
        organised_text=organised_text(found),
        causes=(
            *(_cause(found, finding) for finding in found.there),
            *(_cause(found, finding) for finding in found.findings if finding.name not in found.effects),
            *(CauseNotAsked(name, "", True, str(Verdict.NOT_TESTABLE), why) for name, why in found.lacking.items()),  # noqa: FBT003
        ),
        left=ComparisonResidual(not found.left.is_noise, found.left.probability, residual_text(found.left)),
        only_in_a=pairs.only_a,
        only_in_b=pairs.only_b,
        unlike=tuple(unlike),
        drawing=drawing,
        notes=notes,
    )


def _cause(found: Comparison, finding: CauseFinding) -> ComparedCause:
    effect = found.effects.get(finding.name)
    return of_facts(
        ComparedCause,
        finding if effect is None else effect,
        finding,
        form=finding.label if effect is not None else "",
        named=finding.form is None,
        acts=finding.acts.name.lower(),
        rms_um=None if effect is None else effect.rms_um,
        log_evidence=finding.log_bayes_factor,
        spans=tuple(VariableSpan(**vars(one)) for one in finding.spans),
        parameters=finding.values,
    )


def label_of(finding: CauseFinding) -> str:
    """Return a cause's name with its form, such as strut, test or session."""
    return f"{finding.name}, {finding.label}" if finding.label else finding.name


def verdict_text(found: Comparison) -> str:
    """Return the conclusion in a sentence."""
    many = sum(run.differs for run in found.runs)
    if found.differ and found.there:
        where = f"in {many} of {len(found.runs)} runs" if many else "over all runs, though in no single one for sure"
        return (
            f"The sessions differ {where}, by {1e3 * found.found_rms_mm:.2f} µm rms beyond noise and what is stated of balls "
            f"and bars (probability {found.probability:.3f})."
        )
    if found.differ:
        return "The sessions differ, and no form that was tried describes how: the residual is not noise."
    if found.there:
        return (
            f"These runs do not decide whether the sessions differ (probability {found.probability:.2f}); if they do, it is "
            f"{', '.join(label_of(finding) for finding in found.there)}."
        )
    centre = median_of([run.centre_shift_uncertainty_um for run in found.runs])
    radial = median_of([run.mean_radial_change_uncertainty_um for run in found.runs])
    return (
        f"No difference beyond noise, balls and bars (probability of one {found.probability:.2f}). A strut that had become "
        f"{1e3 * found.noticed_mm:.2g} µm longer would have been found; centres are compared to ± {centre:.2g} µm, mean lengths "
        f"to ± {radial:.2g} µm."
    )


def organised_text(found: Comparison) -> str:
    """Return a summary of the findings."""
    if not found.there:
        return "nothing to organise"
    parts = []
    for finding in found.there:
        effect = found.effects[finding.name]
        sizes = "; ".join(f"{name} {value.in_words}" for name, value in finding.values.items())
        parts.append(
            f"{label_of(finding)}, {100 * effect.share:.0f} %"
            + (f" ({sizes})" if 0 < len(sizes) < BOUNDS.line_of_values else "")
        )
    return " + ".join(parts)


def residual_text(left: LeftOver) -> str:
    """Return the residual beyond noise in a sentence."""
    if left.is_noise:
        return "The residual is noise."
    worst = left.worst
    where = f", {worst.where}" if worst.where else ""
    return f"The residual is not noise: {worst.name}, {1e3 * worst.rms:.2g} µm rms{where}."
