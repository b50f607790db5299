"""Make the result of a comparison of two sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.compare.words import organised_text, residual_text, verdict_text
from dbbstation.inference.verdict import Verdict
from dbbstation.results.comparison import (
    CauseNotAsked,
    ComparedCause,
    ComparisonResidual,
    ComparisonResult,
    VariableSpan,
)
from dbbstation.results.diagnosis import BeforeAfter
from dbbstation.results.frame import of_facts

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.compare.comparison import Comparison
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
    largest_first = sorted(found.runs, key=lambda run: (-run.differs, -float(np.sum(run.found_mm**2)), -run.rms_um))
    pairs, held_out = found.matching, found.trial.held_out
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
        held_out="not-tested" if held_out is None else "tested",
        held_out_worse=None if held_out is None else held_out.is_worse,
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
