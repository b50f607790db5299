"""From a comparison of two sessions to its result."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.compare.words import by_angle_um, organised_text, residual_text, verdict_text
from dbbstation.inference.verdict import Verdict
from dbbstation.results.comparison import (
    CauseNotAsked,
    ComparedCause,
    ComparedRun,
    ComparisonResidual,
    ComparisonResult,
    DirectionHalves,
    LargestEffect,
    NotComparable,
    VariableSpan,
)
from dbbstation.results.diagnosis import BeforeAfter

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.compare.comparison import Comparison, RunDifference
    from dbbstation.inference.read_off import CauseFinding


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
    largest_first = sorted(found.runs, key=lambda run: (-run.differs, -float(np.sum(run.found_mm**2)), -run.rms_mm))
    pairs, halves, held_out = found.matching, found.halves_mm, found.trial.held_out
    before, after = found.held_out
    return ComparisonResult(
        a=a,
        b=b,
        text=verdict_text(found),
        differ=found.differ,
        probability_of_difference=found.probability,
        runs_compared=len(found.runs),
        runs_different=sum(run.differs for run in found.runs),
        difference_rms_um=1e3 * found.rms_mm,
        beyond_chance_rms_um=1e3 * found.found_rms_mm,
        noise_rms_um=1e3 * found.noise_mm,
        strut_change_noticed_um=1e3 * found.noticed_mm,
        held_out="not-tested" if held_out is None else "tested",
        held_out_worse=None if held_out is None else held_out.is_worse,
        held_out_rms_um=BeforeAfter(1e3 * before.rms, 1e3 * after.rms),
        runs=tuple(_run(run) for run in largest_first),
        directions=None if halves is None else DirectionHalves(1e3 * halves[0], 1e3 * halves[1]),
        cancelling=found.cancelling,
        organised_text=organised_text(found),
        causes=(
            *(_cause(found, finding) for finding in found.there),
            *(_cause(found, finding) for finding in found.findings if finding.name not in found.effects),
            *(CauseNotAsked(name, "", True, str(Verdict.NOT_TESTABLE), why) for name, why in found.lacking.items()),  # noqa: FBT003
        ),
        left=ComparisonResidual(not found.left.is_noise, found.left.probability, residual_text(found.left)),
        only_in_a=tuple(pairs.only_a),
        only_in_b=tuple(pairs.only_b),
        not_comparable=tuple(NotComparable(test, what) for test, what in pairs.not_comparable),
        averaged=tuple(pairs.averaged),
        unlike=tuple(unlike),
        levels=found.levels,
        drawing=drawing,
        notes=notes,
    )


def _cause(found: Comparison, finding: CauseFinding) -> ComparedCause:
    effect = found.effects.get(finding.name)
    where = None
    if effect is not None:
        first, last = effect.theta_deg
        text = (
            f"up to {1e3 * effect.peak_mm:+.1f} µm in test {effect.test} {effect.direction}, "
            f"{first:.0f} to {last:.0f} degrees"
        )
        where = LargestEffect(effect.test, str(effect.direction), (first, last), 1e3 * effect.peak_mm, text)
    return ComparedCause(
        name=finding.name,
        form=finding.label if effect is not None else "",
        named=finding.form is None,
        verdict=str(finding.verdict),
        acts=finding.acts.name.lower(),
        persists=finding.persists,
        recurs=finding.recurs,
        gains=finding.gains,
        probability=finding.probability,
        log_evidence=finding.log_bayes_factor,
        ambiguous_with=tuple(finding.ambiguous_with),
        equivalent=tuple(finding.equivalent),
        rms_um=None if effect is None else 1e3 * effect.rms_mm,
        share=None if effect is None else effect.share,
        taken_up=None if effect is None else effect.taken_up,
        opposite=None if effect is None else effect.opposite,
        where=where,
        spans=tuple(VariableSpan(one.variable, one.low, one.high, one.unit) for one in finding.spans),
        parameters=finding.values,
        text=finding.text,
    )


def _run(run: RunDifference) -> ComparedRun:
    angle_deg, peak_mm = run.peak
    return ComparedRun(
        test=run.pair.test,
        direction=str(run.pair.direction),
        number=run.pair.number,
        repeats_a=tuple(one.repeat for one in run.pair.a),
        repeats_b=tuple(one.repeat for one in run.pair.b),
        differs=run.differs,
        found_rms_um=1e3 * float(np.sqrt(np.mean(run.found_mm**2))),
        found_sigmas=run.sigmas,
        rms_um=1e3 * run.rms_mm,
        noise_rms_um=1e3 * run.noise_mm,
        centre_shift_um=(1e3 * run.centre_mm[0], 1e3 * run.centre_mm[1]),
        centre_shift_uncertainty_um=1e3 * run.centre_sigma_mm,
        mean_radial_change_um=1e3 * run.radial_mm,
        mean_radial_change_uncertainty_um=1e3 * run.radial_sigma_mm,
        circularity_um=1e3 * run.circularity_mm,
        peak_um=1e3 * peak_mm,
        peak_theta_deg=angle_deg,
        by_angle_um=tuple(by_angle_um(run).tolist()),
    )
