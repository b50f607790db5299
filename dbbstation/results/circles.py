"""Measured circles with their figures, the result of `circles`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated

from dbbstation.circles.analysis import EDITION
from dbbstation.circles.budget import Budget, budget_of, budgets, pair_budgets, spectrum_of
from dbbstation.circles.estimates import BudgetQuantity
from dbbstation.circles.quick_look import Symptom, quick_look
from dbbstation.circles.reversals import Harmonic, ReversalStep
from dbbstation.facts import OfRunInSession, of_facts, picked
from dbbstation.facts.serialise import Absent, AsItIs, Kept
from dbbstation.facts.value import finite
from dbbstation.quality.finding import Finding
from dbbstation.quality.limits import FALSE_ALARMS_PER_RUN
from dbbstation.results.frame import Framed

if TYPE_CHECKING:
    from dbbstation.circles.analysis import CircleAnalysis, PairAnalysis
    from dbbstation.circles.budget import FormSpectrum, SetUpKnowledge
    from dbbstation.circles.path import Filter
    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.quality.judge import Judgement


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
        named = picked(self, "session", "test", "direction", "repeat")
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
            if isinstance(value, str | int | float):
                found[key] = value
            elif isinstance(value, LargestAndLeast | PlaneVector):
                found |= {f"{key.removesuffix('_um')}_{part}_um": number for part, number in vars(value).items()}
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


@dataclass(frozen=True, eq=False)
class MeasuredCircle:
    """One accepted run.

    Attributes:
        analysis: None without a circle.
        known: stated facts of bar and ball.
    """

    session: str
    entry: RunEntry
    analysis: CircleAnalysis | None
    problem: str
    known: SetUpKnowledge
    judgement: Judgement | None

    def budget(self, quantity: BudgetQuantity = BudgetQuantity.G) -> Budget:
        """Return a figure of the circle with its uncertainty."""
        return budget_of(self.analysed, quantity, self.known)

    @cached_property
    def spectrum(self) -> FormSpectrum:
        """Return the circle's undulations."""
        return spectrum_of(self.analysed)

    @property
    def analysed(self) -> CircleAnalysis:
        """Return the analysis of a circle that is shown."""
        if self.analysis is None:
            raise ValueError("a run without a circle has no figures")
        return self.analysis


@dataclass(frozen=True, eq=False)
class MeasuredPair:
    """One circle in both directions."""

    one: MeasuredCircle
    other: MeasuredCircle
    analysis: PairAnalysis


@dataclass(frozen=True)
class Circled:
    """Circles of one or more sessions."""

    circles: tuple[MeasuredCircle, ...]
    pairs: tuple[MeasuredPair, ...]
    warnings: tuple[str, ...]
    sessions: tuple[SessionFolder, ...]

    @property
    def shown(self) -> list[MeasuredCircle]:
        """Return the runs that show a circle."""
        return [one for one in self.circles if one.analysis is not None]


NO_CIRCLES = Circled((), (), (), ())


@dataclass(frozen=True, kw_only=True, eq=False)
class CirclesResult(Framed):
    """Figures of measured circles after ISO 230-4, as in `circles --json`.

    Attributes:
        filter: of G, F and H, in words.
        false_alarms_per_run: basis of the findings' limits.
        runs: figures with budgets; lengths in µm.
    """

    edition: str
    filter: str
    reference_circle: Mapping[str, str]
    false_alarms_per_run: float
    runs: tuple[CircleFiguresResult | RunWithoutCircle, ...]
    pairs: tuple[PairFigures, ...]
    quick_look: Annotated[tuple[QuickLookResult, ...] | None, Absent] = None
    csv: Annotated[str | None, Absent] = None
    circles: Annotated[Circled, AsItIs, Kept] = field(repr=False)

    def headline(self) -> str:
        """Return the number of circles and their greatest G."""
        found = [one.analysed.g_um for one in self.circles.shown]
        return (
            f"{len(self.runs)} circles, G up to {max(found):.2f} µm"
            if found
            else f"{len(self.runs)} runs without a circle"
        )

    def rows(self) -> list[dict[str, object]]:
        """Return all numbers, a row per circle."""
        return [run.row() for run in self.runs]


def with_budgets(result: CirclesResult) -> list[CircleFiguresResult | PairFigures]:
    """Return the runs that show a circle, and the pairs."""
    return [*(run for run in result.runs if not isinstance(run, RunWithoutCircle)), *result.pairs]


def not_stated(result: CirclesResult) -> list[str]:
    """Return the contributions to uncertainty without a stated size."""
    budgets = (budget for one in with_budgets(result) for budget in one.uncertainty.values())
    return list(dict.fromkeys(cause for budget in budgets for cause in budget.missing))


def why_not(result: CirclesResult) -> list[str]:
    """Return a sentence per reason why figures have no uncertainty."""
    of: dict[str, dict[str, None]] = {}
    for one in with_budgets(result):
        for figure, budget in one.uncertainty.items():
            if budget.why_not:
                of.setdefault(budget.why_not, {})[figure] = None
    return [f"{', '.join(figures)}: {why}" for why, figures in of.items()]


def circles_result(found: Circled, chosen: Filter, *, quick_look: bool = False) -> CirclesResult:
    """Return the figures of circles."""
    return CirclesResult(
        edition=EDITION,
        filter=chosen.words,
        reference_circle={"g_um": "minimum zone", "g_least_squares_um": "least squares", "f_um": "least squares"},
        false_alarms_per_run=FALSE_ALARMS_PER_RUN,
        runs=tuple(_run(circle) for circle in found.circles),
        pairs=tuple(_pair(pair) for pair in found.pairs),
        quick_look=tuple(_quick_looks(found)) if quick_look else None,
        circles=found,
        notes=found.warnings,
    )


def _run(circle: MeasuredCircle) -> CircleFiguresResult | RunWithoutCircle:
    entry, one = circle.entry, circle.analysis
    findings = None if circle.judgement is None else tuple(circle.judgement.findings)
    if one is None:
        name = (circle.session, entry.test, str(entry.direction), entry.repeat)
        return RunWithoutCircle(*name, circle.problem or None, findings)
    return circle_figures(circle, one, findings)


def circle_figures(
    circle: MeasuredCircle, one: CircleAnalysis, findings: tuple[Finding, ...] | None = None
) -> CircleFiguresResult:
    """Return the figures of one circle with their uncertainties."""
    entry = circle.entry
    figures, (x_mm, y_mm), raw = budgets(one, circle.known), one.centre_mm, one.raw
    value_um = {quantity: budget.value_um for quantity, budget in figures.items()}
    return of_facts(
        CircleFiguresResult,
        circle,
        entry,
        raw.circle,
        one,
        one.path,
        direction=str(raw.circle.direction),
        problem=circle.problem or None,
        tilt_deg=tuple(raw.circle.tilt_deg),
        samples=len(raw),
        samples_lost=one.lost,
        g_um=value_um[BudgetQuantity.G],
        g_least_squares_um=value_um[BudgetQuantity.G_LS],
        f_um=LargestAndLeast(value_um[BudgetQuantity.F_MAX], value_um[BudgetQuantity.F_MIN]),
        f_about_commanded_centre_um=LargestAndLeast(one.f_commanded.largest_um, one.f_commanded.least_um),
        centre_um=PlaneVector(1e3 * x_mm, 1e3 * y_mm),
        harmonics=tuple(one.harmonics),
        reversal_steps=tuple(one.steps),
        drift_um_per_turn=None if one.passes is None else one.passes.mean_um,
        feed_shown_mm_min=None if one.feed_mm_min is None else ShownFeed(*one.feed_mm_min),
        noise_um=NoiseFigures(finite(one.noise.slow_um), finite(one.noise.reading_um), one.noise.resolution_um),
        uncertainty={str(quantity): budget for quantity, budget in figures.items()},
        findings=findings,
    )


def _pair(pair: MeasuredPair) -> PairFigures:
    figures = pair_budgets(pair.analysis, pair.one.known)
    return of_facts(
        PairFigures,
        pair.one,
        pair.one.entry,
        pair.analysis,
        g_um=figures[BudgetQuantity.G_BOTH].value_um,
        g_least_squares_um=figures[BudgetQuantity.G_BOTH_LS].value_um,
        h_um=figures[BudgetQuantity.H].value_um,
        uncertainty={str(quantity): budget for quantity, budget in figures.items()},
    )


def _quick_looks(found: Circled) -> list[QuickLookResult]:
    partner = {id(pair.one): pair.other for pair in found.pairs}
    second = {id(pair.other) for pair in found.pairs}
    looks = []
    for circle in found.shown:
        if id(circle) in second:
            continue
        turns = [one for one in (circle, partner.get(id(circle))) if one is not None]
        looked = quick_look([one.analysed for one in turns])
        looks.append(
            QuickLookResult(
                session=circle.session,
                test=circle.entry.test,
                repeat=circle.entry.repeat,
                directions=tuple(str(one.entry.direction) for one in turns),
                symptoms=() if looked is None else tuple(looked.symptoms),
                form_rms_um=None if looked is None else looked.form_rms_um,
                left_rms_um=None if looked is None else looked.left_rms_um,
            )
        )
    return looks
