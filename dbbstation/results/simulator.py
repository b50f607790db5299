"""The result of `mismatch --simulator`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from dbbstation.diagnosis.simulator.answer import RefittedOfSimulator
from dbbstation.diagnosis.simulator.separate import SeparatingInput
from dbbstation.facts.serialise import Absent, Kept
from dbbstation.facts.value import Value
from dbbstation.files.atomic import write_text
from dbbstation.files.provenance import Provenance
from dbbstation.inference.left_over import LeftOver
from dbbstation.inference.levels import Levels
from dbbstation.inference.verdict import Gains
from dbbstation.results.frame import Framed, picked
from dbbstation.results.levels_text import level_sentences


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

    def sentences(self) -> list[str]:
        """Return the answer in three levels, in words."""
        return level_sentences(self.levels, self.unit, {one.name: one.values for one in self.findings})

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:  # noqa: ARG002 - code states none
        write_text(path, self.code, force=force)

    def rows(self) -> list[dict[str, object]]:
        """Return one row per term."""
        shown = ("name", "verdict", "port", "probability", "log_bayes_factor", "rms", "confounded", "text")
        return [picked(one, *shown) for one in self.findings]
