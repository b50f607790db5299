"""Figures of circles and findings as plain numbers: what `--json` prints and reports show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.circles.quantity import BudgetQuantity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.circles.analysis import CircleAnalysis, Deviations, PairAnalysis
    from dbbstation.circles.budget import Budget
    from dbbstation.circles.quick_look import QuickLook
    from dbbstation.circles.reversals import ReversalStep


def circle_summary(one: CircleAnalysis, budgets: Mapping[BudgetQuantity, Budget]) -> dict[str, Any]:
    """Figures of one circle, lengths in µm unless the key says otherwise; None where something cannot be determined."""
    x, y = one.centre_mm
    return {
        "direction": str(one.raw.circle.direction),
        "tilt_deg": list(one.raw.circle.tilt_deg),
        "elevation_deg": one.raw.circle.elevation_deg,
        "radius_mm": one.path.radius_mm,
        "bar_mm": one.raw.circle.bar_mm,
        "feed_mm_min": one.raw.circle.feed_mm_min,
        "samples": len(one.raw),
        "samples_lost": one.lost,
        "g_um": budgets[BudgetQuantity.G].value_um,
        "g_least_squares_um": budgets[BudgetQuantity.G_LS].value_um,
        "f_um": {"max": budgets[BudgetQuantity.F_MAX].value_um, "min": budgets[BudgetQuantity.F_MIN].value_um},
        "f_about_commanded_centre_um": _deviations(one.f_commanded),
        "radius_error_um": one.radius_error_um,
        "mean_radial_error_um": one.mean_radial_error_um,
        "centre_um": {"x": 1e3 * x, "y": 1e3 * y},
        "harmonics": [
            {"undulations": h.undulations, "amplitude_um": h.amplitude_um, "peak_deg": h.peak_deg}
            for h in one.harmonics
        ],
        "reversal_steps": [_step(step) for step in one.steps],
        "closure": None if one.closure is None else _step(one.closure),
        "drift_um_per_turn": None if one.passes is None else one.passes.mean_um,
        "feed_shown_mm_min": None
        if one.feed_mm_min is None
        else {"value": one.feed_mm_min[0], "u": one.feed_mm_min[1]},
        "noise_um": {
            "of_slow_figures": _finite(one.noise.slow_um),
            "of_a_reading": _finite(one.noise.reading_um),
            "step_of_readings": one.noise.resolution_um,
        },
        "uncertainty": budget_summary(budgets),
    }


def pair_summary(pair: PairAnalysis, budgets: Mapping[BudgetQuantity, Budget]) -> dict[str, Any]:
    """Figures of both directions of a circle [µm]."""
    return {
        "g_um": budgets[BudgetQuantity.G_BOTH].value_um,
        "g_least_squares_um": budgets[BudgetQuantity.G_BOTH_LS].value_um,
        "d_um": pair.d_um,
        "h_um": budgets[BudgetQuantity.H].value_um,
        "h_deg": pair.h_deg,
        "uncertainty": budget_summary(budgets),
    }


def budget_summary(budgets: Mapping[BudgetQuantity, Budget]) -> dict[str, Any]:
    """Standard uncertainty u, its terms, what is missing, and the figure with its noise, by figure [µm]; u is None where why_not says why."""
    return {
        str(quantity): {
            "u_um": budget.u_um,
            "terms_um": {str(cause): float(size) for cause, size in budget.terms_um.items()},
            "missing": list(budget.missing),
            "why_not": budget.why_not or None,
            "value_um": budget.value_um,
            "as_read_um": budget.as_read_um,
        }
        for quantity, budget in budgets.items()
    }


def quick_look_summary(found: QuickLook | None) -> dict[str, Any]:
    """Signatures of serial axes as plain numbers, u beside each; without symptoms where there are too few samples."""
    if found is None:
        return {"symptoms": [], "form_rms_um": None, "left_rms_um": None}
    return {
        "symptoms": [
            {
                "signature": str(one.signature),
                "place": one.place or None,
                "value": one.value,
                "u": one.u,
                "below": one.below,
                "unit": one.unit,
                "seen": one.seen,
                "text": one.text or None,
            }
            for one in found.symptoms
        ],
        "form_rms_um": found.form_rms_um,
        "left_rms_um": found.left_rms_um,
    }


def _deviations(both: Deviations) -> dict[str, float]:
    return {"max": both.largest_um, "min": both.least_um}


def _step(step: ReversalStep) -> dict[str, float]:
    return {"theta_deg": step.theta_deg, "height_um": step.height_um, "u_um": step.u_um}


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
