"""Where a simulation and a recording differ, and what was left out: the result of `mismatch`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from dbbstation.facts.serialise import Absent, AsItIs, Kept
from dbbstation.facts.value import Value
from dbbstation.inference.cancelling import Cancelling
from dbbstation.inference.left_over import LeftOver
from dbbstation.inference.levels import Levels
from dbbstation.inference.read_off import Span
from dbbstation.inference.verdict import Gains
from dbbstation.results.frame import Framed


@dataclass(frozen=True)
class VariableResult:
    """A column that the difference may follow.

    Attributes:
        kind: such as `angle` or `time`.
        unit: of its values; empty where it has none.
        period: after which it is the same again, in that unit; None where it has none.
    """

    name: str
    kind: str
    unit: str
    period: float | None
    low: float
    high: float


@dataclass(frozen=True)
class OffsetResult(Value):
    """Measured less simulated value on average."""

    significant: bool


@dataclass(frozen=True)
class SearchBeginning:
    """What a search that began in one way ended at."""

    beside: str
    log_odds: float
    effects: tuple[str, ...]


@dataclass(frozen=True)
class NoiseResult:
    """Noise of one row.

    Attributes:
        sigma: standard deviation, in the unit of the table.
        rows_as_one: neighbours that count as one row, since their noise is alike.
        measured_in_order: whether the order of the rows is known.
        order: of the autoregression that describes neighbours.
        degrees_of_freedom: of Student's t; None where it is normal.
        grows_with: variable that its variance grows with; None where it is the same everywhere.
    """

    sigma: float
    rows_as_one: float
    measured_in_order: bool
    order: int
    degrees_of_freedom: float | None
    grows_with: str | None
    beginnings: tuple[SearchBeginning, ...]


@dataclass(frozen=True)
class ResidualRms:
    """Root mean square of measured less simulated values, in the unit of the table.

    Attributes:
        before: with parameters refitted and nothing found.
    """

    before: float
    after: float


@dataclass(frozen=True)
class HeldOutPart:
    """Errors of one part that took no part in anything, in the unit of the table.

    Attributes:
        as_simulated: rms of measured less simulated value.
        before: with parameters refitted.
    """

    name: str
    rows: int
    as_simulated: float
    before: float
    after: float


@dataclass(frozen=True)
class HeldOutRms:
    """Errors of all held-out parts, in the unit of the table.

    Attributes:
        before: with parameters refitted.
        worse: whether corrected values predict worse than those as simulated.
    """

    as_simulated: float
    before: float
    after: float
    worse: bool
    folds: tuple[HeldOutPart, ...]


@dataclass(frozen=True)
class VariableShare:
    """What of the mismatch follows one variable.

    Attributes:
        rms: of all effects over it, in the unit of the table.
        share: of all that is explained, what these bring alone.
        terms: how many effects.
    """

    variable: str
    rms: float
    share: float
    lost: float
    terms: int


@dataclass(frozen=True, kw_only=True)
class EffectResult:
    """What was found of one effect.

    Attributes:
        verdict: one of the six words of docs/verdicts.md.
        acts: `always` or `once`.
        persists: it happened once, and other parts tell of it, too.
        recurs: it happened more than once.
        gains: in parts that did not choose it; None where these were not asked for.
        form: family of forms; None for physics of one's own.
        sigmas: norm of it over its standard deviation.
        confounded: R² of it on the parameters.
        rows: first and last row of what happened once.
        blocks: size in each run, by name.
        equivalent: effects that these rows cannot tell from it.
        resembles: R² of it on named forms.
    """

    name: str
    verdict: str
    acts: str
    persists: bool
    recurs: bool
    gains: Gains | None
    form: str | None
    variables: tuple[str, ...]
    probability: float
    log_bayes_factor: float
    rms: float
    sigmas: float
    confounded: float
    values: Mapping[str, Value]
    spans: tuple[Span, ...]
    rows_there: float
    rows: tuple[tuple[int, ...], ...]
    blocks: Mapping[str, float]
    equivalent: tuple[str, ...]
    ambiguous_with: tuple[str, ...]
    resembles: Mapping[str, float]
    text: str


@dataclass(frozen=True)
class RefittedResult:
    """A parameter of the simulation, fitted anew.

    Attributes:
        before: change alone, by ordinary least squares.
        after: change beside what was found.
        confounded: R² of the parameter on what was found.
        known: standard uncertainty to which it was known before; None where it was free.
        stated: whether the user gave that.
        far: whether it moved so far that its derivative, or what was known of it, must be asked again.
    """

    name: str
    before: Value
    after: Value
    shift: float
    confounded: float
    known: float | None
    stated: bool
    far: bool


@dataclass(frozen=True)
class NextMeasurement:
    """What to measure next."""

    text: str
    variables: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class MismatchResult(Framed):
    """What is found of a table of measured and simulated values.

    Attributes:
        unit: of measured and simulated values; empty where it has none.
        blocks: names of the runs.
        variables: that the difference may follow.
        levels: whether anything differs, what it follows, which law it is.
        mismatch: whether there is more than noise.
        offset: measured less simulated on average; None where none was allowed.
        held_out_rms: errors of held-out parts; None where not tested.
        cancelling: effects that cancel each other; None where none do.
        parameters: of the simulation, fitted anew.
        left: whether something is left beyond noise.
        second_start_agrees: whether a search that begins with nothing ends at the same effects.
        not_asked: physics of one's own that could not be asked, and why, by name.
        out: file of the corrected table; absent where none was written.
        figure: file of the figure; absent where none was written.
        table: columns of the files by name, with the corrected simulation and what it leaves as further ones.
    """

    unit: str
    row_count: Annotated[int, Field(serialization_alias="rows")]
    blocks: tuple[str, ...]
    variables: tuple[VariableResult, ...]
    levels: Levels
    mismatch: bool
    offset: OffsetResult | None
    noise: NoiseResult
    residual_rms: ResidualRms
    held_out: str
    held_out_rms: HeldOutRms | None
    cancelling: Cancelling | None
    led_by: tuple[VariableShare, ...]
    findings: tuple[EffectResult, ...]
    parameters: tuple[RefittedResult, ...]
    left: LeftOver
    second_start_agrees: bool
    second_start_log_odds: float
    next: tuple[NextMeasurement, ...]
    not_asked: Mapping[str, str]
    out: Annotated[str | None, Absent] = None
    figure: Annotated[str | None, Absent] = None
    table: Annotated[Mapping[str, tuple[str | float, ...]], AsItIs, Kept]

    def rows(self) -> list[dict[str, object]]:
        """One dictionary for each effect."""
        return [
            {
                "name": one.name,
                "verdict": one.verdict,
                "probability": one.probability,
                "log_bayes_factor": one.log_bayes_factor,
                "rms": one.rms,
                "confounded": one.confounded,
                "text": one.text,
            }
            for one in self.findings
        ]
