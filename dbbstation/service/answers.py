"""What the station shows of the results of its steps; a result has more, and files have all of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TextAnswer:
    """Something in words."""

    text: str


@dataclass(frozen=True)
class MisfitAnswer:
    """Whether physics is missing, and how much is left beyond noise and mountings [µm]."""

    missing_physics: bool
    rms_um: float


@dataclass(frozen=True)
class PlanCheckAnswer:
    """Whether the tests are enough to check their plan, how many there are, and how many degrees of freedom are left for it."""

    enough: bool
    tests: int
    left: int


@dataclass(frozen=True)
class CalibrationAnswer:
    """What is shown of a calibration; lengths in µm.

    Attributes:
        misfit: beyond noise and mountings.
        gaps: what the plan cannot see, in words.
        plan_check: whether the tests can show a wrong plan.
    """

    parameters_identified: int
    nominal_rms_um: float
    residual_rms_um: float
    residual_within_mounting_rms_um: float
    noise_um: float
    misfit: MisfitAnswer
    outliers: tuple[TextAnswer, ...]
    directions_lost: tuple[str, ...]
    gaps: tuple[str, ...]
    plan_check: PlanCheckAnswer


@dataclass(frozen=True)
class CauseAnswer:
    """A cause and its verdict."""

    name: str
    verdict: str


@dataclass(frozen=True)
class DiagnosisAnswer:
    """What is shown of a diagnosis; lengths in µm.

    Attributes:
        mismatch: whether the calibration leaves more than noise and mountings.
        unexplained: what no cause explains.
        next_test: what to measure next; None for nothing.
    """

    mismatch: bool
    misfit_rms_um: float
    noise_um: float
    sources: tuple[CauseAnswer, ...]
    unexplained: TextAnswer
    next_test: TextAnswer | None


@dataclass(frozen=True)
class ProgramAnswer:
    """The greatest correction of a program [µm]; None of a nominal one."""

    greatest_correction_um: float | None


@dataclass(frozen=True)
class ProgramsAnswer:
    """What is shown of programs: the dialect and each of them."""

    dialect: str
    programs: tuple[ProgramAnswer, ...]


@dataclass(frozen=True)
class VerdictAnswer:
    """What the tolerances of the shop say.

    Attributes:
        kind: `within`, `exceeded`, `cannot tell` or `none`.
        reasons: one sentence for each tolerance that is not kept.
        to_do: what to do, in order.
    """

    kind: str
    headline: str
    reasons: tuple[str, ...]
    to_do: tuple[str, ...]


@dataclass(frozen=True)
class WorstAnswer:
    """The circle with the largest figure, and its U; None where nobody knows it [µm]."""

    test: str
    direction: str
    repeat: int
    um: float
    expanded_um: float | None


@dataclass(frozen=True, kw_only=True)
class HeldAnswer:
    """A tolerance held against circles.

    Attributes:
        conformity: `within`, `exceeded` or `cannot tell`; None where it holds for none.
        worst: the circle with the largest figure; None likewise.
    """

    quantity: str
    largest_um: float
    conformity: str | None
    worst: WorstAnswer | None


@dataclass(frozen=True, kw_only=True)
class ToleranceAnswer(HeldAnswer):
    """A tolerance held against circles now, and before; None where it held for none then."""

    before: HeldAnswer | None


@dataclass(frozen=True, kw_only=True)
class ToleranceOfTestAnswer(ToleranceAnswer):
    """A tolerance held against the circles of one test."""

    test: str


@dataclass(frozen=True)
class ReportAnswer:
    """What is shown of a report."""

    verdict: VerdictAnswer


@dataclass(frozen=True)
class AcceptanceAnswer(ReportAnswer):
    """What is shown of a report of two sessions: every tolerance, and every tolerance of each test."""

    tolerances: tuple[ToleranceAnswer, ...]
    tolerances_by_test: tuple[ToleranceOfTestAnswer, ...]
