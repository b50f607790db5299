"""The result of `mismatch --simulator`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.diagnosis.simulator.answer import RefittedOfSimulator
from dbbstation.diagnosis.simulator.nodes import spread_of
from dbbstation.diagnosis.simulator.separate import SeparatingInput
from dbbstation.diagnosis.table.words import CONFOUNDED
from dbbstation.facts import of_facts
from dbbstation.facts.serialise import Absent, Kept
from dbbstation.facts.value import Value, finite
from dbbstation.files.atomic import write_text
from dbbstation.files.provenance import Provenance
from dbbstation.inference.left_over import LeftOver
from dbbstation.inference.levels import Gains, Levels, Verdict
from dbbstation.results.frame import Framed
from dbbstation.results.levels_text import level_sentences

if TYPE_CHECKING:
    from dbbstation.diagnosis.simulator.answer import SimulatorComparison
    from dbbstation.inference.read_off import CauseFinding


@dataclass(frozen=True)
class SimulatedOutput:
    """An output of the simulator."""

    name: str
    unit: str
    divided_by: float
    noise: float


@dataclass(frozen=True)
class SimulatedRun:
    """A recording."""

    name: str
    rows: int


@dataclass(frozen=True)
class SimulationRms:
    """Rms of measured minus simulated values."""

    as_simulated: float
    refitted: float
    corrected: float


@dataclass(frozen=True)
class SimulationNoise:
    """Noise of one row."""

    sigma: float
    rows_as_one: float
    degrees_of_freedom: float | None


@dataclass(frozen=True)
class HeldOutSimulation(SimulationRms):
    """Errors of one held-out part."""

    name: str
    rows: int


@dataclass(frozen=True)
class HeldOutSimulations(SimulationRms):
    """Errors of all held-out parts.

    Attributes:
        worse: whether corrected values predict worse than simulated ones.
    """

    worse: bool
    parts: tuple[HeldOutSimulation, ...]


@dataclass(frozen=True, kw_only=True)
class PortTerm:
    """Findings on one term.

    Attributes:
        sigmas: norm of its effect over the standard deviation.
        confounded: R² of its effect on the parameters.
        linear_and_true_differ_by: distance of linear and simulated answer; None if unknown.
    """

    name: str
    verdict: str
    port: str
    about: str
    form: str
    put_in: bool
    probability: float
    log_bayes_factor: float
    rms: float
    sigmas: float
    confounded: float
    linear_and_true_differ_by: float | None
    values: Mapping[str, Value]
    gains: Gains | None
    equivalent: tuple[str, ...]
    ambiguous_with: tuple[str, ...]
    text: str


@dataclass(frozen=True)
class SimulationsRun:
    """Number of simulations."""

    run: int
    most: int | None
    one_s: float
    kept: int = 0


@dataclass(frozen=True, kw_only=True)
class SimulatorResult(Framed):
    """The terms that a simulator lacks.

    Attributes:
        levels: existence, signals and ports, and term of a difference.
        settled: whether the search ended at one set of terms.
        not_asked: terms not compared, with reasons by name.
    """

    simulator: str
    unit: str
    outputs: tuple[SimulatedOutput, ...]
    runs: tuple[SimulatedRun, ...]
    levels: Levels
    mismatch: bool
    rms: SimulationRms
    noise: SimulationNoise
    settled: bool
    stopped: str
    held_out: str
    held_out_rms: HeldOutSimulations | None
    findings: tuple[PortTerm, ...]
    parameters: tuple[RefittedOfSimulator, ...]
    left: LeftOver
    next: tuple[SeparatingInput, ...]
    not_asked: Mapping[str, str]
    simulations: SimulationsRun
    out: Annotated[str | None, Absent] = None
    corrected: Annotated[str | None, Absent] = None
    figure: Annotated[str | None, Absent] = None
    code: Annotated[str, Kept] = ""
    rows_csv: Annotated[str, Kept] = ""
    _table_of = "findings", "name, verdict, port, probability, log_bayes_factor, rms, confounded, text"

    def sentences(self) -> list[str]:
        """Return the answer in three levels, in words."""
        return level_sentences(self.levels, self.unit, {one.name: one.values for one in self.findings})

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:  # noqa: ARG002 - code states none
        write_text(path, self.code, force=force)


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
                model.outputs, answer.work.scales, spread_of(answer.work, settled.bank), strict=True
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
