"""Sentences of a comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS

if TYPE_CHECKING:
    from dbbstation.diagnosis.compare.comparison import Comparison
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.read_off import CauseFinding


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
    centre = float(np.median([run.centre_shift_uncertainty_um for run in found.runs]))
    radial = float(np.median([run.mean_radial_change_uncertainty_um for run in found.runs]))
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
