"""The answer of a simulator in the loop as plain numbers: what `--json` prints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from dbbstation.diagnosis.simulator.separate import separating_input
from dbbstation.inference.verdict import Verdict

if TYPE_CHECKING:
    from dbbstation.diagnosis.simulator.answer import Moved, SimulatorComparison
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.inference.verdict import Value


def simulator_summary(answer: SimulatorComparison) -> dict[str, Any]:
    """Everything that is said."""
    found, settled = answer.found, answer.found.settled
    as_simulated, refitted, corrected = answer.rms
    held_out = answer.held_out
    return {
        "simulator": answer.model.name,
        "unit": answer.model.outputs[0].unit,
        "outputs": [
            {"name": o.name, "unit": o.unit, "divided_by": float(s)}
            for o, s in zip(answer.model.outputs, answer.work.scales, strict=True)
        ],
        "runs": [{"name": run.name, "rows": len(run)} for run in answer.model.runs],
        "mismatch": bool(answer.terms) or not answer.left.is_noise,
        "rms": {"as_simulated": as_simulated, "refitted": refitted, "corrected": corrected},
        "noise": {
            "sigma": settled.noise.sigma,
            "rows_as_one": settled.noise.correlation_samples,
            "degrees_of_freedom": None if math.isinf(settled.bank.tails) else settled.bank.tails,
        },
        "settled": found.is_settled,
        "stopped": answer.stopped,
        "held_out": "not-tested" if held_out is None else "tested",
        "held_out_rms": None
        if held_out is None
        else {
            "as_simulated": held_out.as_simulated,
            "refitted": held_out.before,
            "corrected": held_out.after,
            "worse": held_out.is_worse,
            "parts": [
                {
                    "name": f.name,
                    "rows": f.rows,
                    "as_simulated": f.as_simulated,
                    "refitted": f.before,
                    "corrected": f.after,
                }
                for f in held_out.folds
            ],
        },
        "findings": [_finding(answer, one) for one in answer.findings],
        "parameters": [_parameter(one) for one in answer.parameters],
        "left": {
            "is_noise": answer.left.is_noise,
            "probability": answer.left.probability,
            "looks": [
                {"name": look.name, "probability": look.probability, "rms": look.rms, "where": look.where}
                for look in answer.left.looks
            ],
        },
        "next": separating_input(answer),
        "not_asked": dict(answer.not_asked),
    }


def _finding(answer: SimulatorComparison, one: CauseFinding) -> dict[str, Any]:
    term = next((term for term in answer.terms if term.name == one.name), None)
    port = next((port for port in answer.model.ports if one.name.endswith(f" at {port.name}")), None)
    return {
        "name": one.name,
        "verdict": str(one.verdict),
        "port": port.name if port else "",
        "about": port.about if port else "",
        "form": str(term.form) if term else one.name.split(" of ")[0].split(" at ")[0],
        "put_in": term is not None,
        "probability": one.probability,
        "log_bayes_factor": one.log_factor,
        "rms": one.rms,
        "sigmas": one.sigmas,
        "confounded": one.confounded,
        "linear_and_true_differ_by": _finite(answer.nonlinear.get(one.name)),
        "values": {name: _value(value) for name, value in one.values.items()},
        "gains": None
        if one.gains is None
        else {
            "parts": list(one.gains.parts),
            "with_gain": one.gains.with_gain,
            "total": one.gains.total,
            "predicts": one.gains.predicts,
        },
        "equivalent": list(one.equivalent),
        "ambiguous_with": list(one.ambiguous_with),
        "text": one.text or _why(one),
    }


def _why(one: CauseFinding) -> str:
    """Sentence for a finding that has none of its own."""
    if one.verdict is Verdict.IDENTIFIED:
        hidden = (
            f" The parameters had taken up {100.0 * one.confounded:.0f} % of it." if one.confounded > HIDDEN else ""
        )
        return f"The recordings want it, and nothing else that was asked does as well.{hidden}"
    return ""


HIDDEN = 0.1
"""Share of an effect that parameters had taken up from which on it is said."""


def _parameter(one: Moved) -> dict[str, Any]:
    u = math.hypot(one.before.uncertainty, 0.0)
    return {
        "name": one.name,
        "unit": one.before.unit,
        "stated": one.stated,
        "refitted": _value(one.before),
        "corrected": _value(one.after),
        "shift": one.after.value - one.before.value,
        "shift_over_u": _finite((one.after.value - one.before.value) / u if u > 0.0 else None),
        "confounded": one.confounded,
        "not_told_apart_from": None if one.alike is None else list(one.alike),
    }


def _value(value: Value) -> dict[str, Any]:
    return {"value": value.value, "uncertainty": _finite(value.uncertainty), "unit": value.unit}


def _finite(number: float | None) -> float | None:
    return number if number is not None and math.isfinite(number) else None
