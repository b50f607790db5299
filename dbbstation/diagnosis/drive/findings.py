"""What is found of one strut drive: verdicts, places, numbers with their uncertainty. Its fields are the keys of the JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.facts.value import Value
from dbbstation.inference.cancelling import Cancelling
from dbbstation.inference.verdict import Acts, Gains, Verdict


@dataclass(frozen=True)
class DriveValue(Value):
    """A parameter of the drive.

    Attributes:
        identifiable: False where this recording cannot tell it; the value then means nothing by itself.
    """

    identifiable: bool


@dataclass(frozen=True)
class CausePart:
    """One wave, pulse or form of a cause.

    Attributes:
        label: which; empty where there is one only.
        t_s: first and last time of a pulse [s]; None where it is none.
    """

    label: str
    t_s: tuple[float, float] | None
    parameters: Mapping[str, Value]


@dataclass(frozen=True)
class Complement:
    """The other way to read pulses of one size: the opposite force in the rest of the time, and a constant load."""

    force_n: Value
    t_s: tuple[tuple[float, float], ...]
    pulses: Annotated[int, Kept]


@dataclass(frozen=True, kw_only=True)
class DriveFinding:
    """What is said of one cause.

    Attributes:
        ambiguous_with: causes that would explain the recording about as well in its place.
        concealed: share of its signature's sum of squares that mass and viscous friction take up.
        unconcealed_rms_n: of what mass and viscous friction leave of it [N].
        probability: that it is there, or one that nothing recorded here tells from it.
        gain: log Bayes factor of it beside the others.
        parameters: as fitted; for a cause that was not, best amplitudes, whose uncertainty says how much could hide.
        parts: where it is there more than once (waves, pulses, forms), each with its numbers.
        at_end: names of parameters that lie at the end of the values that are tried.
        complement: stretches of time that explain as much in the place of `parts`.
        persists: it happened once, such as friction that drifts, and held-out parts tell of it, too.
        gains: what it brought in held-out parts [N²]; None: not asked for.
        text: sentences for people.
    """

    name: str
    verdict: Verdict
    ambiguous_with: tuple[str, ...]
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
        text: kind and variable, such as `curve over speed`.
        rms_n: of it beside mass and viscous friction [N].
        low, high: range of the variable in which it is at least half as large as anywhere; `from` and `to` in JSON.
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
    """A stretch of the recording in which a misfit stands out.

    Attributes:
        direction: `forwards` or `backwards`.
        at_reversal: a reversal or stop lies in it or beside it.
        variable: that it follows; None where nothing does.
        share: of the misfit's sum of squares.
        peak_n: greatest deviation, measured minus model [N].
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
    """A model on the way from the base to the last one, and how it predicts the stretch that was held back.

    Attributes:
        added: cause that this step adds; None for the base.
        relative_force_error: |F - F_model| / |F| on the stretch, fitted without it.
        parameters: values fitted without the stretch, by name.
    """

    added: str | None
    relative_force_error: float
    fitted_error: float
    parameters: Mapping[str, float]


@dataclass(frozen=True)
class ForceErrors:
    """A figure with mass and viscous friction alone (before), and with everything found (after)."""

    before: float
    after: float


@dataclass(frozen=True)
class HeldBack:
    """How models predict a stretch that was held back.

    Attributes:
        relative_force_error: |F - F_model| / |F| there.
        steps: from mass and viscous friction to the last model.
        not_in_model: causes that were fitted beside it and are not in it, since nothing decides on them.
    """

    t_s: tuple[float, float]
    relative_force_error: ForceErrors
    steps: tuple[ModelStep, ...]
    not_in_model: tuple[str, ...]


@dataclass(frozen=True)
class ParameterBias:
    """How far what was left out had pulled a parameter: before, after, before less after, uncertainty of the value after."""

    parameter: str
    before: float
    after: float
    shift: float
    uncertainty: float
    unit: str


@dataclass(frozen=True)
class UnexplainedForces:
    """The unmodelled residual.

    Attributes:
        probability: of such a rest or a larger one by noise alone.
        variable: what organises it; None where nothing does clearly.
        text: one sentence for people.
        effects: without a name that the comparison found, largest first.
    """

    rms_n: float
    probability: float
    significant: bool
    variable: str | None
    text: str
    effects: tuple[UnexplainedForce, ...]
    locations: tuple[ForceLocation, ...]


@dataclass(frozen=True)
class HeldOutForce:
    """Predictions of parts that were held out, everything chosen anew without each of them.

    Attributes:
        reference: root mean square error of the law of mass, viscous and Coulomb friction [N].
        corrected: of everything that was chosen, but for what happens in time [N].
        worse: whether everything together predicts worse than mass and friction alone.
        gains: of each source that was chosen without some part, by name, in N².
    """

    parts: int
    reference: float
    corrected: float
    worse: bool
    gains: Annotated[Mapping[str, Gains], Kept]


@dataclass(frozen=True)
class RecordedSignals:
    """What was recorded.

    Attributes:
        cutoff_hz: band in which force and model are compared [Hz].
        shortest_wave_mm: shortest wave over the position that could be seen [mm]; None where none could.
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
    """Friction against speed, all causes that hang on the speed together.

    Attributes:
        speed_m_s: shape (c,) [m/s].
    """

    speed_m_s: NDArray[np.float64]
    force_n: NDArray[np.float64]
    uncertainty_n: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveFindings:
    """Everything found of one strut drive.

    Attributes:
        mismatch: the recording differs from mass and viscous friction beyond noise.
        probability: of as much by chance.
        misfit_rms_n: of mass and viscous friction beyond noise [N].
        held_back: how models predict a stretch that was held back.
        parameters: of the last model, base parameters first.
        parameter_shift: how far what was left out had pulled them.
        friction: Coulomb and viscous friction per direction; empty where not identifiable.
        locations: of the base model's misfit, largest share first.
        sources: causes, best first.
        cancelling: forces that cancel each other; None where none do.
        held_out_rms_n: errors of held-out parts; None where not tested.
        noticed: in the recordings; `notes` in JSON.
        table: what was compared, sample by sample, by column.
        before: parameters of the base model.
        chosen: causes in the last model, those first that move the force most beside mass and viscous friction.
        curve: friction against speed.
    """

    mismatch: bool
    probability: float
    noise_n: float
    noise_correlation_samples: float
    misfit_rms_n: float
    residual_rms_n: ForceErrors
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
    table: Annotated[Mapping[str, NDArray[np.float64]], AsItIs, Kept]
    before: Annotated[Mapping[str, DriveValue], AsItIs, Kept]
    chosen: Annotated[tuple[str, ...], AsItIs, Kept]
    curve: Annotated[FrictionCurve, AsItIs, Kept]
