"""What a simulator lacks, and at which port: the result of `mismatch --simulator`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from dbbstation.facts.serialise import Absent
from dbbstation.facts.value import Value
from dbbstation.inference.left_over import LeftOver
from dbbstation.inference.levels import Levels
from dbbstation.inference.verdict import Gains
from dbbstation.results.frame import Framed


@dataclass(frozen=True)
class SimulatedOutput:
    """An output of the simulator.

    Attributes:
        noise: standard deviation of one row of it, in its unit.
    """

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
    """Root mean square of measured less simulated values.

    Attributes:
        corrected: with missing terms put in.
    """

    as_simulated: float
    refitted: float
    corrected: float


@dataclass(frozen=True)
class SimulationNoise:
    """Noise of one row.

    Attributes:
        degrees_of_freedom: of Student's t; None where it is normal.
    """

    sigma: float
    rows_as_one: float
    degrees_of_freedom: float | None


@dataclass(frozen=True)
class HeldOutSimulation(SimulationRms):
    """Errors of one part that took no part."""

    name: str
    rows: int


@dataclass(frozen=True)
class HeldOutSimulations(SimulationRms):
    """Errors of all held-out parts.

    Attributes:
        worse: whether corrected values predict worse than those as simulated.
    """

    worse: bool
    parts: tuple[HeldOutSimulation, ...]


@dataclass(frozen=True, kw_only=True)
class PortTerm:
    """What was found of one term.

    Attributes:
        verdict: one of the six words of docs/verdicts.md.
        about: what the model file says of that.
        form: how it follows its signals.
        sigmas: norm of its effect over its standard deviation.
        confounded: R² of its effect on the parameters.
        linear_and_true_differ_by: how far the linear answer is from the simulated one; None where not known.
        gains: in parts that did not choose it; None where these were not asked for.
        equivalent: terms that these recordings cannot tell from it.
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
class SimulatorParameterResult:
    """A parameter of the simulator.

    Attributes:
        stated: as the model file states it.
        refitted: without any term.
        corrected: with what was found put in.
        shift_over_u: in standard uncertainties of the first; None where that is not known.
        confounded: R² of it on what was found.
        not_told_apart_from: parameters that the recordings cannot tell from it; None where they can.
    """

    name: str
    unit: str
    stated: float
    refitted: Value
    corrected: Value
    shift: float
    shift_over_u: float | None
    confounded: float
    not_told_apart_from: tuple[str, ...] | None


@dataclass(frozen=True)
class SeparatingInput:
    """What to record to tell two terms apart.

    Attributes:
        part: stretch of the recordings in which they differ most.
        sigmas: standard deviations by which they differ there.
        repeats: of that stretch until they are distinguished.
        input: under which they would differ most, in words; None where none that was tried does better than those recorded.
        input_sigmas: standard deviations by which they would differ under it, in a recording as long.
    """

    text: str
    terms: tuple[str, ...]
    part: str
    sigmas: float
    repeats: int
    input: str | None
    input_sigmas: float
    recorded_sigmas: float


@dataclass(frozen=True)
class SimulationsRun:
    """How many simulations it took.

    Attributes:
        most: that were allowed; None where nobody set a limit.
    """

    run: int
    most: int | None
    one_s: float
    kept: int = 0


@dataclass(frozen=True, kw_only=True)
class SimulatorResult(Framed):
    """What a simulator lacks.

    Attributes:
        levels: whether anything differs, which signals at which ports it follows, which term it is.
        settled: whether the search ended at one set of terms.
        stopped: why it ended early; empty where it did not.
        held_out_rms: errors of held-out parts; None where not tested.
        left: whether something is left beyond noise.
        not_asked: terms that were not compared in the end, and why, by name.
        out: file of the missing terms as code; absent where none was written.
        corrected: file of the corrected values; absent where none was written.
        figure: file of the figure; absent where none was written.
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
    parameters: tuple[SimulatorParameterResult, ...]
    left: LeftOver
    next: tuple[SeparatingInput, ...]
    not_asked: Mapping[str, str]
    simulations: SimulationsRun
    out: Annotated[str | None, Absent] = None
    corrected: Annotated[str | None, Absent] = None
    figure: Annotated[str | None, Absent] = None

    def rows(self) -> list[dict[str, object]]:
        """One dictionary for each term."""
        return [
            {
                "name": one.name,
                "verdict": one.verdict,
                "port": one.port,
                "probability": one.probability,
                "log_bayes_factor": one.log_bayes_factor,
                "rms": one.rms,
                "confounded": one.confounded,
                "text": one.text,
            }
            for one in self.findings
        ]
