"""The comparison of a table as plain numbers: what `--json` prints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from dbbstation.diagnosis.table.next_measurement import next_measurements
from dbbstation.diagnosis.table.words import sentence_of

if TYPE_CHECKING:
    from dbbstation.diagnosis.table.mismatch import Mismatch
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.inference.verdict import Value


def mismatch_summary(found: Mismatch) -> dict[str, Any]:
    """Everything that is said."""
    table, settled, noise = found.table, found.settled, found.settled.noise
    ordered = settled.channel.time is not None
    return {
        "unit": table.unit,
        "rows": len(table),
        "blocks": list(table.names),
        "variables": [
            {
                "name": v.name,
                "kind": str(v.kind),
                "unit": v.unit,
                "period": v.period,
                "low": v.low,
                "high": v.high,
            }
            for v in table.variables
        ],
        "mismatch": found.is_there,
        "offset": None if found.offset is None else {**_value(found.offset), "significant": found.offset_is_there},
        "noise": {
            "sigma": noise.sigma,
            "rows_as_one": noise.correlation_samples,
            "measured_in_order": ordered,
            "order": noise.order,
            "degrees_of_freedom": None if math.isinf(settled.bank.tails) else settled.bank.tails,
            "grows_with": settled.bank.grows_with or None,
            "beginnings": [
                {
                    "beside": one.beginning.value,
                    "log_odds": one.log_probability - settled.log_probability,
                    "effects": sorted(one.best.names),
                }
                for one in (settled, *settled.others)
            ],
        },
        "residual_rms": {"before": found.rms_before, "after": found.rms_after},
        "held_out": "not-tested" if found.held_out is None else "tested",
        "held_out_rms": None
        if found.held_out is None
        else {
            "as_simulated": found.held_out.as_simulated,
            "before": found.held_out.before,
            "after": found.held_out.after,
            "worse": found.is_worse,
            "folds": [
                {
                    "name": fold.name,
                    "rows": fold.rows,
                    "as_simulated": fold.as_simulated,
                    "before": fold.before,
                    "after": fold.after,
                }
                for fold in found.held_out.folds
            ],
        },
        "cancelling": None
        if found.cancelling is None
        else {"rms": found.cancelling.rms, "rms_of_sum": found.cancelling.rms_of_sum},
        "led_by": [
            {"variable": s.variable, "rms": s.rms, "share": s.share, "lost": s.lost, "terms": s.terms}
            for s in found.shares
        ],
        "findings": [_finding(found, finding) for finding in found.findings],
        "parameters": [
            {
                "name": p.name,
                "before": _value(p.before),
                "after": _value(p.after),
                "shift": p.after.value - p.before.value,
                "confounded": p.confounded,
                "known": p.known,
                "stated": p.stated,
                "far": p.is_far,
            }
            for p in found.fitted
        ],
        "left": {
            "is_noise": found.left.is_noise,
            "probability": found.left.probability,
            "looks": [
                {"name": look.name, "probability": look.probability, "rms": look.rms, "where": look.where}
                for look in found.left.looks
            ],
        },
        "second_start_agrees": found.second_start == 0.0,
        "second_start_log_odds": found.second_start,
        "next": [{"text": step.text, "variables": list(step.variables)} for step in next_measurements(found)],
        "not_asked": found.lacking,
    }


def _finding(found: Mismatch, finding: CauseFinding) -> dict[str, Any]:
    return {
        "name": finding.name,
        "verdict": str(finding.verdict),
        "acts": finding.acts.name.lower(),
        "persists": finding.persists,
        "recurs": finding.recurs,
        "gains": None if finding.gains is None else finding.gains.plain(),
        "form": None if finding.family is None else str(finding.family),
        "variables": list(finding.variables),
        "probability": finding.probability,
        "log_bayes_factor": finding.log_factor,
        "rms": finding.rms,
        "sigmas": finding.sigmas,
        "confounded": finding.confounded,
        "values": {name: _value(value) for name, value in finding.values.items()},
        "spans": [{"variable": s.variable, "low": s.low, "high": s.high, "unit": s.unit} for s in finding.spans],
        "rows_there": finding.rows_there,
        "rows": [list(rows) for rows in finding.rows],
        "blocks": dict(zip(found.table.names, finding.blocks, strict=True)) if finding.blocks else {},
        "equivalent": list(finding.equivalent),
        "ambiguous_with": list(finding.ambiguous_with),
        "resembles": found.resembles.get(finding.name, {}),
        "text": sentence_of(found, finding),
    }


def _value(value: Value) -> dict[str, Any]:
    known = math.isfinite(value.uncertainty)
    return {"value": value.value, "uncertainty": value.uncertainty if known else None, "unit": value.unit}
