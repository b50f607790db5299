"""Findings on one strut drive; fields are JSON keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from dbbstation.computing.arrays import Floats
from dbbstation.facts import BeforeAfter
from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.facts.value import Value
from dbbstation.inference.alternatives import Cancelling
from dbbstation.inference.levels import Acts, CatalogueFinding, Gains, Levels


@dataclass(frozen=True)
class DriveValue(Value):
    """A parameter of the drive.

    Attributes:
        identifiable: False if the value is meaningless.
    """

    identifiable: bool


@dataclass(frozen=True)
class CausePart:
    """One wave, pulse or form.

    Attributes:
        t_s: first and last times of a pulse; else None.
    """

    label: str
    t_s: tuple[float, float] | None
    parameters: Mapping[str, Value]


@dataclass(frozen=True)
class Complement:
    """Inverse description of equal pulses: the opposite force elsewhere, plus a constant load."""

    force_n: Value
    t_s: tuple[tuple[float, float], ...]
    pulses: Annotated[int, Kept]


@dataclass(frozen=True, kw_only=True)
class DriveFinding(CatalogueFinding):
    """Finding on one cause.

    Attributes:
        concealed: share of squares that mass and viscous friction absorb.
        gain: log Bayes factor given the others.
        parameters: fitted values; for an absent cause the best amplitudes, whose uncertainty bounds an undetected effect.
        at_end: parameters at a limit of their grid.
        complement: alternative stretches to `parts`.
        persists: whether held-out parts confirm a single event, such as drift.
        gains: held-out [N²]; None if not tested.
    """

    concealed: float
    signature_rms_n: float
    unconcealed_rms_n: float
    probability: float
    gain: float
    parameters: Mapping[str, Value]
    parts: tuple[CausePart, ...]
    at_end: tuple[str, ...]
    complement: Complement | None
    acts: Acts
    persists: bool
    gains: Gains | None
    text: str


@dataclass(frozen=True)
class UnexplainedForce:
    """An unmodelled force.

    Attributes:
        text: such as `curve over speed`.
        low, high: range of the variable with at least half of the largest effect; `from` and `to` in JSON.
    """

    text: str
    variable: str
    probability: float
    rms_n: float
    low: Annotated[float, Field(serialization_alias="from")]
    high: Annotated[float, Field(serialization_alias="to")]
    unit: str


@dataclass(frozen=True)
class ForceLocation:
    """A stretch with significant misfit.

    Attributes:
        direction: `forwards` or `backwards`.
        at_reversal: whether it is at a reversal or stop.
        peak_n: measured minus model.
    """

    t_s: tuple[float, float]
    position_mm: tuple[float, float]
    direction: str
    at_reversal: bool
    variable: str | None
    share: float
    peak_n: float
    text: str


@dataclass(frozen=True)
class ModelStep:
    """One model of a sequence, and its prediction of a held-out stretch.

    Attributes:
        relative_force_error: |F - F_model| / |F| on the stretch.
    """

    added: str | None
    relative_force_error: float
    fitted_error: float
    parameters: Mapping[str, float]


@dataclass(frozen=True)
class HeldBack:
    """Prediction errors on a held-out stretch, with mass and viscous friction (before), and with all findings (after)."""

    t_s: tuple[float, float]
    relative_force_error: BeforeAfter
    steps: tuple[ModelStep, ...]
    not_in_model: tuple[str, ...]


@dataclass(frozen=True)
class ParameterBias:
    """A parameter's bias: value before, value after, difference, uncertainty after."""

    parameter: str
    before: float
    after: float
    shift: float
    uncertainty: float
    unit: str


@dataclass(frozen=True)
class UnexplainedForces:
    """The unmodelled residual."""

    rms_n: float
    probability: float
    significant: bool
    variable: str | None
    text: str
    effects: tuple[UnexplainedForce, ...]
    locations: tuple[ForceLocation, ...]


@dataclass(frozen=True)
class HeldOutForce:
    """Prediction errors of held-out parts, with selection repeated.

    Attributes:
        reference: rms error with mass, viscous and Coulomb friction.
        corrected: rms error with all findings except events in time.
        worse: whether `corrected` exceeds `reference`.
        gains: by source [N²].
    """

    parts: int
    reference: float
    corrected: float
    worse: bool
    gains: Annotated[Mapping[str, Gains], Kept]


@dataclass(frozen=True)
class RecordedSignals:
    """Properties of the recordings.

    Attributes:
        shortest_wave_mm: shortest detectable wave over position, or None.
    """

    recordings: int
    samples: int
    samples_compared: int
    rate_hz: float
    cutoff_hz: float
    shortest_wave_mm: float | None
    t_s: tuple[float, float]
    reversals: int
    greatest_speed_mm_s: float
    force_rms_n: float


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Friction over speed, from all speed-dependent causes.

    Attributes:
        speed_m_s: shape (c,) [m/s].
    """

    speed_m_s: Floats
    force_n: Floats
    uncertainty_n: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveFindings:
    """All findings on one strut drive.

    Attributes:
        mismatch: whether effects beyond mass and viscous friction are present.
        parameters: base first.
        friction: Coulomb and viscous by direction; may be empty.
        held_out_rms_n: None if not tested.
        noticed: `notes` in JSON.
        chosen: causes of the last model, ordered by force.
    """

    mismatch: bool
    probability: float
    noise_n: float
    noise_correlation_samples: float
    misfit_rms_n: float
    residual_rms_n: BeforeAfter
    held_back: HeldBack
    parameters: Mapping[str, DriveValue]
    parameter_shift: tuple[ParameterBias, ...]
    friction: Mapping[str, Mapping[str, Value]]
    locations: tuple[ForceLocation, ...]
    sources: tuple[DriveFinding, ...]
    unexplained: UnexplainedForces
    cancelling: Cancelling | None
    cannot_tell: tuple[str, ...]
    held_out: str
    held_out_rms_n: HeldOutForce | None
    signals: RecordedSignals
    noticed: Annotated[tuple[str, ...], Field(serialization_alias="notes")]
    table: Annotated[Mapping[str, Floats], AsItIs, Kept]
    before: Annotated[Mapping[str, DriveValue], AsItIs, Kept]
    chosen: Annotated[tuple[str, ...], AsItIs, Kept]
    curve: Annotated[FrictionCurve, AsItIs, Kept]
    levels: Levels
