"""A comparison as plain numbers and sentences: what `--json` prints and the command tells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.diagnosis.compare import SIGNIFICANT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.compare import Comparison, RunDifference
    from dbbstation.diagnosis.compare_organised import Organised

SECTORS = 36
"""Means of ten degrees."""

LEAST_PRINTED = 1e-15
"""Probabilities below are not told apart: no distribution is known so far out."""


def comparison_summary(found: Comparison, notes: Sequence[str]) -> dict[str, Any]:
    """Everything a comparison says; lengths in µm, runs worst first.

    Args:
        found: what was found.
        notes: what else was not alike.
    """
    different = {id(found.runs[r]) for r in found.different}
    worst_first = sorted(found.runs, key=lambda run: -run.ratio)
    pairs = found.matching
    return {
        "text": _verdict(found),
        "differ": found.differ,
        "probability": found.probability,
        "runs_compared": len(found.runs),
        "runs_different": len(found.different),
        "difference_rms_um": 1e3 * found.rms_mm,
        "beyond_chance_rms_um": 1e3 * found.beyond_mm,
        "noise_rms_um": 1e3 * found.noise_mm,
        "smallest_noticed_um": 1e3 * found.smallest_mm,
        "runs": [_run(run, differs=id(run) in different) for run in worst_first],
        "directions": None
        if found.halves is None
        else {
            "same_um": 1e3 * found.halves.same_mm,
            "opposite_um": 1e3 * found.halves.opposite_mm,
            "opposite_probability": found.halves.opposite_probability,
        },
        "organised_text": _organised_text(found),
        "organised": [_organised(one) for one in best_of_each(found.organised)],
        "organised_together": [_organised(one) for one in found.taken],
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


def best_of_each(organised: Sequence[Organised]) -> list[Organised]:
    """Best form of every variable, one strut of six or all of them; those beyond chance first."""
    best: dict[str, Organised] = {}
    for one in sorted(organised, key=lambda one: (one.probability >= SIGNIFICANT, one.worth)):
        best.setdefault(one.variable, one)
    return list(best.values())


def chance_text(probability: float) -> str:
    """Give a probability with the digits that mean something."""
    return f"below {LEAST_PRINTED:.0e}" if probability < LEAST_PRINTED else f"{probability:.2g}"


def _verdict(found: Comparison) -> str:
    if not found.differ:
        centre = 1e3 * float(np.median([run.centre_sigma_mm for run in found.runs]))
        radial = 1e3 * float(np.median([run.radial_sigma_mm for run in found.runs]))
        return (
            f"No difference beyond noise and mountings (probability {chance_text(found.probability)}). A smooth "
            f"difference of {1e3 * found.smallest_mm:.2g} µm rms in one run would have been found; centres are compared to "
            f"± {centre:.2g} µm, mean lengths to ± {radial:.2g} µm."
        )
    many = len(found.different)
    where = f"in {many} of {len(found.runs)} runs" if many else "over all runs, though in no single one"
    return (
        f"The sessions differ {where}, by {1e3 * found.beyond_mm:.2f} µm rms beyond noise and mountings (probability by "
        f"chance {chance_text(found.probability)})."
    )


def _organised_text(found: Comparison) -> str:
    if not found.differ:
        return "nothing to organise"
    if not found.taken:
        return "not organised by anything that was looked at"
    parts = []
    for k, one in enumerate(found.taken):
        sizes = ", ".join(
            f"{name} {value:+.2f} ± {sigma:.2g} {unit}"
            for name, value, sigma, unit in one.amplitudes
            if np.isfinite(sigma)
        )
        beside = "beside it " if k else ""
        parts.append(f"{beside}{one.family.name}, {100 * one.share:.0f} %" + (f" ({sizes})" if sizes else ""))
    rest = 100.0 * max(1.0 - sum(one.share for one in found.taken), 0.0)
    return "; ".join(parts) + (f"; {rest:.0f} % is not organised by anything that was looked at" if rest >= 1.0 else "")


def _run(run: RunDifference, *, differs: bool) -> dict[str, Any]:
    angle, peak = run.peak
    return {
        "test": run.pair.test,
        "direction": str(run.pair.direction),
        "number": run.pair.number,
        "repeats_a": [one.repeat for one in run.pair.a],
        "repeats_b": [one.repeat for one in run.pair.b],
        "differs": differs,
        "probability": run.probability,
        "times_chance": run.ratio,
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


def _organised(one: Organised) -> dict[str, Any]:
    return {
        "variable": one.variable,
        "strut": one.strut,
        "share": one.share,
        "share_of_um2": one.plain_share,
        "freedom": one.columns,
        "probability": one.probability,
        "beyond_chance": one.probability < SIGNIFICANT,
        "amplitudes": {
            name: {"value": value, "uncertainty": sigma, "unit": unit} if np.isfinite(sigma) else None
            for name, value, sigma, unit in one.amplitudes
        },
    }
