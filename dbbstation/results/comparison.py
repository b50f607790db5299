"""Where two sessions differ: the result of `compare`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from dbbstation.facts.value import Value
from dbbstation.inference.cancelling import Cancelling
from dbbstation.inference.verdict import Gains
from dbbstation.results.diagnosis import BeforeAfter
from dbbstation.results.frame import Framed


@dataclass(frozen=True, kw_only=True)
class ComparedRun:
    """One run of B less the same run of A.

    Attributes:
        direction: `ccw` or `cw`.
        number: of the comparison in this test and direction.
        differs: whether what was found is there in this run beyond doubt.
        rms_um: of the whole smooth difference [µm].
        centre_shift_um: by how much the centre moved, x and y [µm].
        circularity_um: greatest less least of the difference about its centre [µm].
        peak_um: greatest difference, with its sign [µm].
        by_angle_um: means over ten degrees from +X [µm].
    """

    test: str
    direction: str
    number: int
    repeats_a: tuple[int, ...]
    repeats_b: tuple[int, ...]
    differs: bool
    found_rms_um: float
    found_sigmas: float
    rms_um: float
    noise_rms_um: float
    centre_shift_um: tuple[float, float]
    centre_shift_uncertainty_um: float
    mean_radial_change_um: float
    mean_radial_change_uncertainty_um: float
    circularity_um: float
    peak_um: float
    peak_theta_deg: float
    by_angle_um: tuple[float, ...]


@dataclass(frozen=True)
class DirectionHalves:
    """Parts of the difference that are the same in both directions, and opposite.

    Attributes:
        opposite_um: rms of the part that changes its sign [µm].
    """

    same_um: float
    opposite_um: float


@dataclass(frozen=True)
class LargestEffect:
    """Where a cause does most.

    Attributes:
        direction: `ccw` or `cw`.
    """

    test: str
    direction: str
    theta_deg: tuple[float, float]
    peak_um: float
    text: str


@dataclass(frozen=True)
class VariableSpan:
    """Where along a variable a cause is large."""

    variable: str
    low: Annotated[float, Field(serialization_alias="from")]
    high: Annotated[float, Field(serialization_alias="to")]
    unit: str


@dataclass(frozen=True, kw_only=True)
class ComparedCause:
    """What was found of one cause.

    Attributes:
        form: which strut, test or session, where it is there; else empty.
        verdict: one of the six words of docs/verdicts.md.
        acts: `always` or `once`.
        persists: it happened once, and other tests tell of it, too.
        recurs: a wave over the time that other tests foretell.
        gains: in tests that did not choose it; None where these were not asked for.
        equivalent: causes that these sessions cannot tell from it; `class` in JSON.
        rms_um: of its effect [µm]; None where it is not there.
        taken_up: share that a new calibration would take up; likewise.
        opposite: share that changes its sign with the direction; likewise.
        spans: where along variables it is large.
    """

    name: str
    form: str
    named: bool
    verdict: str
    acts: str
    persists: bool
    recurs: bool
    gains: Gains | None
    probability: float
    log_evidence: float
    ambiguous_with: tuple[str, ...]
    equivalent: Annotated[tuple[str, ...], Field(serialization_alias="class")]
    rms_um: float | None
    share: float | None
    taken_up: float | None
    opposite: float | None
    where: LargestEffect | None
    spans: tuple[VariableSpan, ...]
    parameters: Mapping[str, Value]
    text: str


@dataclass(frozen=True)
class CauseNotAsked:
    """A cause that needs what these sessions do not have.

    Attributes:
        form: empty.
    """

    name: str
    form: str
    named: bool
    verdict: str
    text: str


@dataclass(frozen=True)
class ComparisonResidual:
    """The residual beside everything found.

    Attributes:
        probability: that noise alone leaves as much.
    """

    beyond_noise: bool
    probability: float
    text: str


@dataclass(frozen=True)
class NotComparable:
    """A test that both sessions have and that cannot be compared."""

    test: str
    text: str


@dataclass(frozen=True, kw_only=True)
class ComparisonResult(Framed):
    """Where two sessions differ, B less A.

    Attributes:
        text: what it comes to, in words.
        held_out_worse: whether what was found predicts worse than nothing; None where not tested.
        held_out_rms_um: errors of tests that took no part [µm].
        runs: largest difference first.
        directions: parts that are alike and opposite; None where only one direction was measured.
        cancelling: effects that cancel each other; None where none do.
        not_comparable: tests that cannot be compared.
        averaged: tests whose repeats were averaged.
        unlike: what else was not alike; `notes` in JSON.
    """

    a: str
    b: str
    text: str
    differ: bool
    probability_of_difference: float
    runs_compared: int
    runs_different: int
    difference_rms_um: float
    beyond_chance_rms_um: float
    noise_rms_um: float
    strut_change_noticed_um: float
    held_out: str
    held_out_worse: bool | None
    held_out_rms_um: BeforeAfter
    runs: tuple[ComparedRun, ...]
    directions: DirectionHalves | None
    cancelling: Cancelling | None
    organised_text: str
    causes: tuple[ComparedCause | CauseNotAsked, ...]
    left: ComparisonResidual
    only_in_a: tuple[str, ...]
    only_in_b: tuple[str, ...]
    not_comparable: tuple[NotComparable, ...]
    averaged: tuple[str, ...]
    unlike: Annotated[tuple[str, ...], Field(serialization_alias="notes")]

    def rows(self) -> list[dict[str, object]]:
        """One dictionary for each run."""
        return [
            {
                "test": run.test,
                "direction": run.direction,
                "differs": run.differs,
                "found_rms_um": run.found_rms_um,
                "rms_um": run.rms_um,
                "noise_rms_um": run.noise_rms_um,
                "peak_um": run.peak_um,
                "peak_theta_deg": run.peak_theta_deg,
            }
            for run in self.runs
        ]
