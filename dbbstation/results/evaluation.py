"""What a model leaves of recordings, circle by circle: the result of `evaluate`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.results.frame import Framed
from dbbstation.results.serialise import Absent


@dataclass(frozen=True)
class CircleDeviations:
    """Figures of one circle [CAL Table III].

    Attributes:
        centre_deviation_um: length of the least-squares centre's offset [µm].
        mean_radial_error_um: mean of length less radius about the commanded centre [µm].
        circularity_um: greatest less least deviation from the least-squares circle [µm].
        centre_deviation_from_first_um: distance of the centre from that of the first test in this direction; None of readings
            themselves [µm].
    """

    centre_deviation_um: float
    mean_radial_error_um: float
    circularity_um: float
    centre_deviation_from_first_um: Annotated[float | None, Absent] = None


@dataclass(frozen=True)
class LowPassedCircularity:
    """Circular deviation G of readings low-passed at 30 undulations per revolution.

    Attributes:
        measured: of the readings [µm].
        predicted: of what the model makes the bar read [µm].
        before: of what the nominal machine leaves [µm].
        after: of what the model leaves [µm].
    """

    measured: float
    predicted: float
    before: float
    after: float


@dataclass(frozen=True)
class EvaluatedRun:
    """One run before, under the nominal machine, and after, under the model.

    Attributes:
        test: name of the test.
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        measured: figures of the readings.
        before: figures of what the nominal machine leaves.
        after: figures of what the model leaves.
        circularity_30_upr_um: the circular deviation without the bar's noise; None where it was not asked for.
    """

    test: str
    direction: str
    repeat: int
    measured: CircleDeviations
    before: CircleDeviations
    after: CircleDeviations
    circularity_30_upr_um: Annotated[LowPassedCircularity | None, Absent] = None


@dataclass(frozen=True)
class WorstRun:
    """The run with the largest figure that a tolerance is for.

    Attributes:
        run: test, direction and repeat.
        worst_um: its figure [µm].
        within: whether that is within tolerance.
    """

    run: str
    worst_um: float
    within: bool


@dataclass(frozen=True)
class EvaluatedTolerance:
    """A tolerance, and the worst run under the nominal machine and under the model.

    Attributes:
        quantity: which figure it is for.
        largest_um: the limit [µm].
        tests: that it holds for; empty for all.
        directions: that it holds for; empty for both.
        before: under the nominal machine; None where it holds for no run.
        after: under the model; None where it holds for no run.
    """

    quantity: str
    largest_um: float
    tests: tuple[str, ...]
    directions: tuple[str, ...]
    before: WorstRun | None
    after: WorstRun | None


@dataclass(frozen=True, kw_only=True)
class EvaluationResult(Framed):
    """What a model leaves of recordings, and how true the machine moves without compensation.

    Attributes:
        runs: figures of every run.
        nominal_rms_um: measured less predicted length over all runs under the nominal machine [µm].
        residual_rms_um: the same under the model's machine [µm].
        flatness_um: of X, Y = ±190 mm, as the model predicts it of programs that are not compensated [µm].
        flatness_u_um: its standard uncertainty; None where it is not known [µm].
        parallelism_um: of a move along X, likewise [µm].
        parallelism_u_um: its standard uncertainty; None where it is not known [µm].
        plane_uncertainty_not_known_because: why one of both is not known; None where both are.
        plane_z_mm: commanded Z of that plane [mm].
        plane_without: sources that are left out there, because no pose alone says what they do.
        tolerances: of the shop, held against every circle; None where another result holds them.
    """

    runs: tuple[EvaluatedRun, ...]
    nominal_rms_um: float
    residual_rms_um: float
    flatness_um: float
    flatness_u_um: float | None
    parallelism_um: float
    parallelism_u_um: float | None
    plane_uncertainty_not_known_because: str | None
    plane_z_mm: float
    plane_without: tuple[str, ...]
    tolerances: Annotated[tuple[EvaluatedTolerance, ...] | None, Absent] = ()

    def rows(self) -> list[dict[str, object]]:
        """Figures of the runs, one row for each."""
        return rows_of(self.runs)


def rows_of(runs: tuple[EvaluatedRun, ...]) -> list[dict[str, object]]:
    """Figures of runs as rows of a table; lengths in µm."""
    rows = []
    for run in runs:
        row: dict[str, object] = {"test": run.test, "direction": run.direction, "repeat": run.repeat}
        for when, of in (("measured", run.measured), ("before", run.before), ("after", run.after)):
            row[f"{when}_centre_deviation_um"] = of.centre_deviation_um
            row[f"{when}_mean_radial_error_um"] = of.mean_radial_error_um
            row[f"{when}_circularity_um"] = of.circularity_um
        rows.append(row)
    return rows
