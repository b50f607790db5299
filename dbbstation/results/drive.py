"""Mass, friction and what is left out of one strut drive: the result of `drive`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dbbstation.results.frame import Framed
from dbbstation.results.inference import CancellingResult, HeldOutGains
from dbbstation.results.serialise import Absent, AsItIs, Kept, Quantified


@dataclass(frozen=True)
class ForceErrors:
    """A figure with mass and viscous friction alone (before), and with everything found (after).

    Attributes:
        before: with mass and viscous friction.
        after: with everything found.
    """

    before: float
    after: float


@dataclass(frozen=True)
class ModelStep:
    """A model on the way to the last one, fitted without the stretch that was held back.

    Attributes:
        added: cause that it adds; None for mass and viscous friction.
        relative_force_error: |F - F_model| / |F| on the stretch.
        fitted_error: the same on what was fitted.
        parameters: values, by name.
    """

    added: str | None
    relative_force_error: float
    fitted_error: float
    parameters: Mapping[str, float]


@dataclass(frozen=True)
class HeldBack:
    """How models predict a stretch that was held back.

    Attributes:
        t_s: its first and last time [s].
        relative_force_error: |F - F_model| / |F| there.
        steps: from mass and viscous friction to the last model.
        not_in_model: causes that are not in the model, since nothing decides on them.
    """

    t_s: tuple[float, float]
    relative_force_error: ForceErrors
    steps: tuple[ModelStep, ...]
    not_in_model: tuple[str, ...]


@dataclass(frozen=True)
class DriveValue:
    """A parameter of the drive.

    Attributes:
        value: in its unit; None where it is not known.
        uncertainty: standard uncertainty u [GUM]; None where it is not known.
        unit: of both.
        identifiable: False where this recording cannot tell it.
    """

    value: float | None
    uncertainty: float | None
    unit: str
    identifiable: bool


@dataclass(frozen=True)
class ParameterBias:
    """How far what was left out had pulled a parameter.

    Attributes:
        parameter: its name.
        before: with mass and viscous friction alone.
        after: with everything found.
        shift: before less after.
        uncertainty: standard uncertainty of the value after.
        unit: of all of these.
    """

    parameter: str
    before: float
    after: float
    shift: float
    uncertainty: float
    unit: str


@dataclass(frozen=True)
class ForceLocation:
    """A stretch in which a misfit is large.

    Attributes:
        t_s: first and last time [s].
        position_mm: first and last position [mm].
        direction: `forwards` or `backwards`.
        at_reversal: whether a reversal or stop is in it or beside it.
        variable: that it follows; None where nothing does.
        share: of the misfit's sum of squares.
        peak_n: greatest deviation, measured less model [N].
        text: in words.
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
class CausePart:
    """One wave, pulse or form of a cause.

    Attributes:
        label: which; empty where there is one only.
        t_s: first and last time of a pulse [s]; None where it is none.
        parameters: with their uncertainties.
    """

    label: str
    t_s: tuple[float, float] | None
    parameters: Mapping[str, Quantified]


@dataclass(frozen=True)
class ComplementResult:
    """Stretches of time that explain as much in the place of pulses.

    Attributes:
        force_n: the force there [N].
        t_s: first and last time of each [s].
    """

    force_n: Quantified
    t_s: tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class DriveCause:
    """What was found of one cause.

    Attributes:
        name: of the cause.
        verdict: one of the six words of docs/verdicts.md.
        ambiguous_with: causes that would do about as well in its place.
        concealed: R² of its signature on mass and viscous friction.
        signature_rms_n: of its signature [N].
        unconcealed_rms_n: of what mass and viscous friction cannot imitate of it [N].
        probability: that it is there, or one that nothing recorded tells from it.
        gain: log Bayes factor beside the others.
        parameters: with their uncertainties.
        parts: where it is there more than once.
        at_end: names of numbers at the end of the values that are tried.
        complement: what explains as much in the place of pulses; None where nothing does.
        acts: `always` or `once`.
        persists: it happened once, and held-out parts tell of it, too.
        gains: in held-out parts [N²]; None where these were not asked for.
        text: in words.
    """

    name: str
    verdict: str
    ambiguous_with: tuple[str, ...]
    concealed: float
    signature_rms_n: float
    unconcealed_rms_n: float
    probability: float
    gain: float
    parameters: Mapping[str, Quantified]
    parts: tuple[CausePart, ...]
    at_end: tuple[str, ...]
    complement: ComplementResult | None
    acts: str
    persists: bool
    gains: HeldOutGains | None
    text: str


@dataclass(frozen=True)
class UnexplainedForce:
    """An unmodelled force.

    Attributes:
        text: kind and variable.
        variable: that it follows.
        probability: that it is there.
        rms_n: of it [N].
        low: value of the variable from which on it is large; `from` in JSON.
        high: value up to which it is; `to` in JSON.
        unit: of the variable.
    """

    text: str
    variable: str
    probability: float
    rms_n: float
    low: Annotated[float, Field(serialization_alias="from")]
    high: Annotated[float, Field(serialization_alias="to")]
    unit: str


@dataclass(frozen=True)
class UnexplainedForces:
    """The unmodelled residual.

    Attributes:
        rms_n: beyond noise [N].
        probability: of as much by noise alone.
        significant: whether that is improbable.
        variable: that organises it; None where nothing does.
        text: in words.
        effects: largest first.
        locations: where it is large.
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
    """Errors of held-out parts, everything chosen anew without each of them.

    Attributes:
        parts: how many.
        reference: rms error of mass and friction alone [N].
        corrected: rms error with everything found [N].
        worse: whether the latter is larger.
    """

    parts: int
    reference: float
    corrected: float
    worse: bool


@dataclass(frozen=True)
class SignalsResult:
    """What was recorded.

    Attributes:
        recordings: how many.
        samples: in all.
        samples_compared: within the band.
        rate_hz: of the samples [Hz].
        cutoff_hz: band in which force and model are compared [Hz].
        shortest_wave_mm: shortest wave over the position that could be seen [mm]; None where none could.
        t_s: first and last time [s].
        reversals: in all.
        greatest_speed_mm_s: greatest speed [mm/s].
        force_rms_n: of the force [N].
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


@dataclass(frozen=True, kw_only=True)
class DriveResult(Framed):
    """What is found of one strut drive.

    Attributes:
        mismatch: whether mass and viscous friction leave more than noise.
        probability: of as much by chance.
        noise_n: standard deviation of the force's noise [N].
        noise_correlation_samples: neighbours that count as one.
        misfit_rms_n: of mass and viscous friction beyond noise [N].
        residual_rms_n: before and after [N].
        held_back: how models predict a stretch that was held back.
        parameters: of the last model.
        parameter_shift: how far what was left out had pulled them.
        friction: per direction, Coulomb and viscous friction.
        locations: where the misfit is large.
        sources: causes, those that are there first.
        unexplained: the residual.
        cancelling: forces that cancel each other; None where none do.
        cannot_tell: what these recordings cannot tell, a sentence each.
        held_out: `tested` or `not-tested`.
        held_out_rms_n: errors of held-out parts; None where not tested.
        signals: what was recorded.
        noticed: in the recordings; `notes` in JSON.
        compared: file of what was compared; absent where none was written.
        figure: file of the figure; absent where none was written.
        table: what was compared, sample by sample, by column.
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
    friction: Mapping[str, Mapping[str, Quantified]]
    locations: tuple[ForceLocation, ...]
    sources: tuple[DriveCause, ...]
    unexplained: UnexplainedForces
    cancelling: CancellingResult | None
    cannot_tell: tuple[str, ...]
    held_out: str
    held_out_rms_n: HeldOutForce | None
    signals: SignalsResult
    noticed: Annotated[tuple[str, ...], Field(serialization_alias="notes")]
    compared: Annotated[str | None, Absent] = None
    figure: Annotated[str | None, Absent] = None
    table: Annotated[Mapping[str, NDArray[np.float64]], AsItIs, Kept]

    def rows(self) -> list[dict[str, object]]:
        """One dictionary for each cause."""
        return [
            {
                "name": one.name,
                "verdict": one.verdict,
                "probability": one.probability,
                "gain": one.gain,
                "concealed": one.concealed,
                "signature_rms_n": one.signature_rms_n,
                "text": one.text,
            }
            for one in self.sources
        ]
