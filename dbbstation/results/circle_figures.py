"""Figures of one circle after ISO 230-4 with budgets, as in `circles --json`; lengths in µm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from dbbstation.circles.budget import Budget
from dbbstation.circles.quick_look import Symptom
from dbbstation.circles.reversals import Harmonic, ReversalStep
from dbbstation.facts.run import OfRunInSession
from dbbstation.facts.serialise import Absent
from dbbstation.quality.finding import Finding


@dataclass(frozen=True)
class LargestAndLeast:
    """Largest and least deviation [µm]."""

    max: float
    min: float


@dataclass(frozen=True)
class PlaneVector:
    """A vector in the plane of the circle [µm]."""

    x: float
    y: float


@dataclass(frozen=True)
class ShownFeed:
    """The feed computed from the recording, with standard uncertainty [mm/min]."""

    value: float
    u: float


@dataclass(frozen=True)
class NoiseFigures:
    """Noise of a recording [µm]."""

    of_slow_figures: float | None
    of_a_reading: float | None
    step_of_readings: float


@dataclass(frozen=True)
class RunWithoutCircle(OfRunInSession):
    """A run without circle."""

    problem: str | None
    findings: Annotated[tuple[Finding, ...] | None, Absent] = None

    def row(self) -> dict[str, object]:
        """Return name and findings for a table."""
        named = {"session": self.session, "test": self.test, "direction": self.direction, "repeat": self.repeat}
        return {**named, **({"problem": self.problem} if self.problem else {}), **_verdicts(self.findings)}


@dataclass(frozen=True, kw_only=True)
class CircleFiguresResult(OfRunInSession):
    """Figures of one circle.

    Attributes:
        g_um: circular deviation G, minimum zone.
        g_least_squares_um: circular deviation about the least-squares centre.
        f_um: radial deviations F about the least-squares centre.
        drift_um_per_turn: None without a second pass.
    """

    problem: str | None
    tilt_deg: tuple[float, ...]
    elevation_deg: float
    radius_mm: float
    bar_mm: float
    feed_mm_min: float
    samples: int
    samples_lost: int
    g_um: float
    g_least_squares_um: float
    f_um: LargestAndLeast
    f_about_commanded_centre_um: LargestAndLeast
    radius_error_um: float
    mean_radial_error_um: float
    centre_um: PlaneVector
    harmonics: tuple[Harmonic, ...]
    reversal_steps: tuple[ReversalStep, ...]
    closure: ReversalStep | None
    drift_um_per_turn: float | None
    feed_shown_mm_min: ShownFeed | None
    noise_um: NoiseFigures
    uncertainty: Mapping[str, Budget]
    findings: Annotated[tuple[Finding, ...] | None, Absent] = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.test} {self.direction} {self.repeat}, G {self.g_um:.2f} µm>"

    def row(self) -> dict[str, object]:
        """Return all numbers of the circle for a table."""
        found: dict[str, object] = {}
        for key, value in vars(self).items():
            match value:
                case str() | int() | float():
                    found[key] = value
                case LargestAndLeast() | PlaneVector():
                    found |= {f"{key.removesuffix('_um')}_{part}_um": number for part, number in vars(value).items()}
                case _:
                    pass
        found |= {f"harmonic_{one.undulations}_um": one.amplitude_um for one in self.harmonics}
        found |= {f"step_at_{step.theta_deg:.0f}_deg_um": step.height_um for step in self.reversal_steps}
        if self.closure is not None:
            found["closure_um"] = self.closure.height_um
        found["noise_um"] = self.noise_um.of_a_reading or ""
        for figure, budget in self.uncertainty.items():
            plain = figure.lower().replace("(", "_").replace(")", "").replace(" ", "_")
            found[f"u_{plain}_um"] = "" if budget.u_um is None else budget.u_um
        return found | _verdicts(self.findings)


@dataclass(frozen=True, kw_only=True)
class PairFigures:
    """Figures that combine both directions of a circle.

    Attributes:
        g_um: bidirectional circular deviation G(b), minimum zone.
        d_um: mean bidirectional radial deviation D.
    """

    session: str
    test: str
    repeat: int
    g_um: float
    g_least_squares_um: float
    d_um: float
    h_um: float
    h_deg: float
    uncertainty: Mapping[str, Budget]


@dataclass(frozen=True, kw_only=True)
class QuickLookResult:
    """Signatures of serial axes in one circle; None for too few samples."""

    session: str
    test: str
    repeat: int
    directions: tuple[str, ...]
    symptoms: tuple[Symptom, ...]
    form_rms_um: float | None
    left_rms_um: float | None


def _verdicts(findings: tuple[Finding, ...] | None) -> dict[str, object]:
    return {f"finding_{one.name.replace(' ', '_')}": one.verdict for one in findings or ()}
