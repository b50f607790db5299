"""Make the result of a simulator in the loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.diagnosis.simulator.nodes import spread_of
from dbbstation.diagnosis.table.words import CONFOUNDED
from dbbstation.facts.value import finite
from dbbstation.inference.verdict import Verdict
from dbbstation.results.frame import of_facts
from dbbstation.results.simulator import (
    HeldOutSimulation,
    HeldOutSimulations,
    PortTerm,
    SimulatedOutput,
    SimulatedRun,
    SimulationNoise,
    SimulationRms,
    SimulationsRun,
    SimulatorResult,
)

if TYPE_CHECKING:
    from dbbstation.diagnosis.simulator.answer import SimulatorComparison
    from dbbstation.inference.read_off import CauseFinding


def simulator_result(answer: SimulatorComparison, simulations: SimulationsRun) -> SimulatorResult:
    """Return the result of a simulator."""
    found, settled, model = answer.found, answer.found.settled, answer.model
    return of_facts(
        SimulatorResult,
        answer,
        simulator=model.name,
        unit=model.outputs[0].unit,
        outputs=tuple(
            SimulatedOutput(output.name, output.unit, float(scale), settled.noise.sigma * float(spread * scale))
            for output, scale, spread in zip(
                model.outputs, answer.work.scales, spread_of(answer.work, settled), strict=True
            )
        ),
        runs=tuple(SimulatedRun(run.name, len(run)) for run in model.runs),
        mismatch=answer.is_there,
        rms=SimulationRms(*answer.rms),
        noise=SimulationNoise(settled.noise.sigma, settled.noise.correlation_samples, finite(settled.bank.tails)),
        settled=found.is_settled,
        held_out="not-tested" if answer.held_out is None else "tested",
        held_out_rms=_held_out(answer),
        findings=tuple(_term(answer, one) for one in answer.findings),
        next=answer.separations,
        simulations=simulations,
    )


def _held_out(answer: SimulatorComparison) -> HeldOutSimulations | None:
    held = answer.held_out
    if held is None:
        return None
    parts = (HeldOutSimulation(one.as_simulated, one.before, one.after, one.name, one.rows) for one in held.folds)
    return HeldOutSimulations(held.as_simulated, held.before, held.after, held.is_worse, tuple(parts))


def _term(answer: SimulatorComparison, one: CauseFinding) -> PortTerm:
    term = next((term for term in answer.terms if term.name == one.name), None)
    port = next((port for port in answer.model.ports if one.name.endswith(f" at {port.name}")), None)
    return of_facts(
        PortTerm,
        one,
        port=port.name if port else "",
        about=port.about if port else "",
        form=str(term.form) if term else one.name.split(" of ")[0].split(" at ")[0],
        put_in=term is not None,
        linear_and_true_differ_by=finite(answer.nonlinear.get(one.name)),
        text=one.text or _why(one),
    )


def _why(one: CauseFinding) -> str:
    if one.verdict is not Verdict.IDENTIFIED:
        return ""
    hidden = (
        f" The parameters had taken up {100.0 * one.confounded:.0f} % of it." if one.confounded > CONFOUNDED else ""
    )
    return f"The recordings want it, and nothing else that was asked does as well.{hidden}"
