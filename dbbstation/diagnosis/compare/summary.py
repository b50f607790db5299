"""A comparison as plain numbers and sentences: what `--json` prints and the command tells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.inference.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.compare.comparison import Comparison, RunDifference
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.read_off import CauseFinding

SECTORS = 36
"""Means of ten degrees."""


def comparison_summary(found: Comparison, notes: Sequence[str]) -> dict[str, Any]:
    """Everything a comparison says; lengths in µm, runs largest first.

    Args:
        found: what was found.
        notes: what else was not alike.
    """
    largest_first = sorted(found.runs, key=lambda run: (-run.differs, -float(np.sum(run.found_mm**2)), -run.rms_mm))
    pairs, halves = found.matching, found.halves_mm
    return {
        "text": _verdict(found),
        "differ": found.differ,
        "probability_of_difference": found.probability,
        "runs_compared": len(found.runs),
        "runs_different": sum(run.differs for run in found.runs),
        "difference_rms_um": 1e3 * found.rms_mm,
        "beyond_chance_rms_um": 1e3 * found.found_rms_mm,
        "noise_rms_um": 1e3 * found.noise_mm,
        "strut_change_noticed_um": 1e3 * found.noticed_mm,
        "held_out": "not-tested" if found.trial.held_out is None else "tested",
        "held_out_worse": None if found.trial.held_out is None else found.trial.held_out.is_worse,
        "held_out_rms_um": {when: 1e3 * of.rms for when, of in zip(("before", "after"), found.held_out, strict=True)},
        "runs": [_run(run) for run in largest_first],
        "directions": None if halves is None else {"same_um": 1e3 * halves[0], "opposite_um": 1e3 * halves[1]},
        "organised_text": _organised_text(found),
        "causes": [
            *(_cause(found, finding) for finding in found.there),
            *(_cause(found, finding) for finding in found.findings if finding.name not in found.effects),
            *(_lacking(name, why) for name, why in found.lacking.items()),
        ],
        "left": {
            "beyond_noise": not found.left.is_noise,
            "probability": found.left.probability,
            "text": _residual_text(found.left),
        },
        "only_in_a": list(pairs.only_a),
        "only_in_b": list(pairs.only_b),
        "not_comparable": [{"test": test, "text": what} for test, what in pairs.not_comparable],
        "averaged": list(pairs.averaged),
        "notes": list(notes),
    }


def by_angle_um(run: RunDifference) -> NDArray[np.float64]:
    """Means of the smooth difference over ten degrees from +X, shape (36,) [µm]."""
    sector = (run.pair.theta_deg * (SECTORS / 360.0)).astype(np.int64)
    count = np.bincount(sector, minlength=SECTORS)
    return np.asarray(
        1e3 * np.bincount(sector, run.smooth_mm, minlength=SECTORS) / np.maximum(count, 1), dtype=np.float64
    )


def label_of(finding: CauseFinding) -> str:
    """Name of a cause with its form: which strut, which test, in which session."""
    return f"{finding.name}, {finding.label}" if finding.label else finding.name


def _verdict(found: Comparison) -> str:
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
    centre = 1e3 * float(np.median([run.centre_sigma_mm for run in found.runs]))
    radial = 1e3 * float(np.median([run.radial_sigma_mm for run in found.runs]))
    return (
        f"No difference beyond noise, balls and bars (probability of one {found.probability:.2f}). A strut that had become "
        f"{1e3 * found.noticed_mm:.2g} µm longer would have been found; centres are compared to ± {centre:.2g} µm, mean lengths "
        f"to ± {radial:.2g} µm."
    )


def _organised_text(found: Comparison) -> str:
    if not found.there:
        return "nothing to organise"
    parts = []
    for finding in found.there:
        effect = found.effects[finding.name]
        sizes = "; ".join(
            f"{name} {value.value:.4g} ± {value.uncertainty:.2g} {value.unit}".strip()
            for name, value in finding.values.items()
        )
        parts.append(
            f"{label_of(finding)}, {100 * effect.share:.0f} %" + (f" ({sizes})" if 0 < len(sizes) < LONG else "")
        )
    return " + ".join(parts)


LONG = 160
"""Characters of values that a line holds; there is more with `--json`."""


def _residual_text(left: LeftOver) -> str:
    if left.is_noise:
        return "The residual is noise."
    worst = left.worst
    where = f", {worst.where}" if worst.where else ""
    return f"The residual is not noise: {worst.name}, {1e3 * worst.rms:.2g} µm rms{where}."


def _cause(found: Comparison, finding: CauseFinding) -> dict[str, Any]:
    effect = found.effects.get(finding.name)
    return {
        "name": finding.name,
        "form": finding.label if effect is not None else "",
        "named": finding.family is None,
        "verdict": str(finding.verdict),
        "acts": finding.acts.name.lower(),
        "persists": finding.persists,
        "gains": None if finding.gains is None else finding.gains.plain(),
        "probability": finding.probability,
        "log_evidence": finding.log_factor,
        "ambiguous_with": list(finding.ambiguous_with),
        "class": list(finding.equivalent),
        "rms_um": None if effect is None else 1e3 * effect.rms_mm,
        "share": None if effect is None else effect.share,
        "taken_up": None if effect is None else effect.taken_up,
        "opposite": None if effect is None else effect.opposite,
        "where": None
        if effect is None
        else {
            "test": effect.test,
            "direction": effect.direction,
            "theta_deg": list(effect.theta_deg),
            "peak_um": 1e3 * effect.peak_mm,
            "text": f"up to {1e3 * effect.peak_mm:+.1f} µm in test {effect.test} {effect.direction}, "
            f"{effect.theta_deg[0]:.0f} to {effect.theta_deg[1]:.0f} degrees",
        },
        "spans": [{"variable": s.variable, "from": s.low, "to": s.high, "unit": s.unit} for s in finding.spans],
        "parameters": {
            name: {
                "value": v.value,
                "uncertainty": v.uncertainty if np.isfinite(v.uncertainty) else None,
                "unit": v.unit,
            }
            for name, v in finding.values.items()
        },
        "text": finding.text,
    }


def _lacking(name: str, why: str) -> dict[str, Any]:
    return {"name": name, "form": "", "named": True, "verdict": str(Verdict.NOT_TESTABLE), "text": why}


def _run(run: RunDifference) -> dict[str, Any]:
    angle, peak = run.peak
    return {
        "test": run.pair.test,
        "direction": str(run.pair.direction),
        "number": run.pair.number,
        "repeats_a": [one.repeat for one in run.pair.a],
        "repeats_b": [one.repeat for one in run.pair.b],
        "differs": run.differs,
        "found_rms_um": 1e3 * float(np.sqrt(np.mean(run.found_mm**2))),
        "found_sigmas": run.sigmas,
        "rms_um": 1e3 * run.rms_mm,
        "noise_rms_um": 1e3 * run.noise_mm,
        "centre_shift_um": [1e3 * run.centre_mm[0], 1e3 * run.centre_mm[1]],
        "centre_shift_uncertainty_um": 1e3 * run.centre_sigma_mm,
        "mean_radial_change_um": 1e3 * run.radial_mm,
        "mean_radial_change_uncertainty_um": 1e3 * run.radial_sigma_mm,
        "circularity_um": 1e3 * run.circularity_mm,
        "peak_um": 1e3 * peak,
        "peak_theta_deg": angle,
        "by_angle_um": by_angle_um(run).tolist(),
    }
