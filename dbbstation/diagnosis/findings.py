"""What a diagnosis answers: verdicts, places, numbers with their uncertainty. No text is made here twice."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from dbbstation.facts.value import Value
from dbbstation.inference.verdict import Acts, Gains, Verdict

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.diagnosis.shapes import Follows
    from dbbstation.diagnosis.workspace import WorkspaceError
    from dbbstation.inference.cancelling import Cancelling
    from dbbstation.inference.chosen_anew import ChosenAnew
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.inference.held_out import HeldOut
    from dbbstation.inference.limit_reached import LimitReached

__all__ = [
    "Curve",
    "CurvePoint",
    "Diagnosis",
    "Location",
    "NextTest",
    "Shift",
    "SourceFinding",
    "Unexplained",
    "Value",
    "Verdict",
]


@dataclass(frozen=True)
class SourceFinding:
    """What is said of one source.

    Attributes:
        ambiguous_with: sources that would explain the recordings about as well in its place.
        gain: difference in log evidence that it brings.
        concealed: share of its signature's sum of squares that the fitted machine parameters take up.
        whole_um: root mean square of its signature over the runs [µm].
        rest_um: of what the fitted parameters leave of it [µm].
        parameters: values with their uncertainty as fitted; for a source that was not, the best amplitudes beside those that
            were, whose uncertainty says how much could hide.
        text: one sentence for people.
        probability: that it is there, given the recordings and the catalogue of causes; of its class where it has one.
        stability: selection frequency: share of draws of seven tenths of the tests in which it is found again; None where it was
            not tried.
        equivalent: causes that are observationally equivalent to it, itself among them; empty where there are none.
        acts: in the whole session, or once.
        sigmas: norm of its effect over its standard deviation; 0 for a cause that the most probable set has not.
        gains: what it brought in groups of tests that were held back; None where they were not asked.
    """

    name: str
    verdict: Verdict
    ambiguous_with: tuple[str, ...]
    gain: float
    concealed: float
    whole_um: float
    rest_um: float
    parameters: dict[str, Value]
    text: str
    probability: float
    stability: float | None = None
    equivalent: tuple[str, ...] = ()
    acts: Acts = Acts.ALWAYS
    sigmas: float = 0.0
    gains: Gains | None = None

    @property
    def persists(self) -> bool:
        """Whether it happened once, such as a bump, and held-out tests tell of it, too."""
        return self.verdict is Verdict.HAPPENED and self.gains is not None and self.gains.predicts


@dataclass(frozen=True)
class Location:
    """Where the misfit is.

    Attributes:
        direction: `ccw` or `cw`.
        theta_deg: from, to: angles from +X towards +Y [deg].
        strut: 1 to 6 that contributes most there; None where no strut does.
        variable: what organises the misfit; empty where nothing does.
        share: of the misfit's sum of squares.
        peak_um: greatest smoothed deviation there [µm].
    """

    test: str
    direction: str
    theta_deg: tuple[float, float]
    strut: int | None
    variable: str
    share: float
    peak_um: float


@dataclass(frozen=True)
class CurvePoint:
    """One point of a curve: where, its value and one standard uncertainty [µm]."""

    at: float
    value_um: float
    uncertainty_um: float


@dataclass(frozen=True)
class Curve:
    """An unmodelled effect as a function of what organises it.

    Attributes:
        strut: 1 to 6; None where all struts follow it, or no strut's error is meant.
        form: which of its kind, such as the period of a wave or the place of a step, in words; empty where there is one.
        period: of a wave [unit of the variable]; None for what is none.
        direction: in which what it moves does so most, 3 to 6 numbers as `convention` says; empty where that is one number.
        convention: what was taken out of it because fitted parameters make that, in words; empty where nothing was.
        readings_um: root mean square of what it does to the readings [µm].
        unconcealed_um: of what the fitted machine parameters leave of that [µm].
        points: least first; between them the curve is straight, or a wave.
    """

    follows: Follows
    unit: str
    strut: int | None
    form: str
    period: float | None
    direction: tuple[float, ...]
    convention: str
    readings_um: float
    unconcealed_um: float
    points: tuple[CurvePoint, ...]

    @property
    def variable(self) -> str:
        """What it follows, as printed."""
        return str(self.follows)

    @property
    def period_mm(self) -> float | None:
        """Period of a wave of strut length [mm]; None for all others."""
        return self.period if self.follows.variable == "strut-length" else None

    def plain(self) -> dict[str, object]:
        """Return it as plain values for JSON."""
        return {"variable": self.variable, "period_mm": self.period_mm, **asdict(self)}


@dataclass(frozen=True)
class Unexplained:
    """The unmodelled residual.

    Attributes:
        rms_um: beyond noise, in the low harmonics [µm].
        strut: 1 to 6; None where it is not one strut's.
        follows: what organises it; None where nothing does clearly.
        gain: log evidence of that description.
        text: one sentence for people.
        curve: the error along the variable; None where nothing organises it clearly.
    """

    rms_um: float
    strut: int | None
    follows: Follows | None
    gain: float
    text: str
    curve: Curve | None = None

    @property
    def variable(self) -> str | None:
        """What organises it, as printed; None where nothing does clearly."""
        return None if self.follows is None else str(self.follows)


@dataclass(frozen=True)
class Shift:
    """How far a parameter of the earlier calibration had been pulled.

    Attributes:
        before_um: without the sources that were found [µm].
    """

    parameter: str
    before_um: float
    after_um: float
    uncertainty_um: float

    @property
    def shift_um(self) -> float:
        """How far it had been pulled [µm]."""
        return self.before_um - self.after_um


@dataclass(frozen=True)
class NextTest:
    """A test worth measuring next.

    Attributes:
        circle: ball, bar and path: x_mm, y_mm, z_mm, a_deg, b_deg, elevation_deg, feed_mm_min, wait_s.
        source: what it is to reveal or to tell apart.
        sigma_before: standard deviation of its amplitude, or of the combination of its amplitudes that gains most, with the tests
            before it.
    """

    text: str
    circle: dict[str, float]
    source: str
    sigma_before: float
    sigma_after: float
    unit: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything found.

    Attributes:
        mismatch: the recordings differ from the base model beyond noise.
        misfit: of the base model.
        left: misfit of the joint model.
        before: fit of the base model.
        after: joint fit; the same as `before` where nothing was found.
        held_out: predictions of left-out tests, before and after [mm].
        chosen_anew: what was found without each group of tests; None where nothing was named, or there are too few tests.
        outliers: balls and runs that do not belong, kept from pulling the fits.
        workspace: how far the earlier calibration was off elsewhere; None where nothing was found.
        locations: largest share first.
        second_start_agrees: a second search came to the same set of causes; None where somebody stopped the comparison.
        next_tests: best first, each beside those before it; empty where nothing is to be asked.
        cancelling: effects of named causes on the readings that cancel each other [mm]; None where none do.
        limits: what ended at a limit: the search, parameters, the joint fit.
    """

    mismatch: bool
    misfit: Misfit
    left: Misfit
    before: Calibration
    after: Calibration
    held_out: tuple[HeldOut, HeldOut]
    chosen_anew: ChosenAnew | None
    outliers: tuple[Outlier, ...]
    workspace: WorkspaceError | None
    locations: tuple[Location, ...]
    sources: tuple[SourceFinding, ...]
    unexplained: Unexplained
    shifts: tuple[Shift, ...]
    second_start_agrees: bool | None
    next_tests: tuple[NextTest, ...]
    cancelling: Cancelling | None = None
    limits: tuple[LimitReached, ...] = ()
