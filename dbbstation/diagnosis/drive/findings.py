"""What the diagnosis of a drive answers: verdicts, places, numbers with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.diagnosis.drive.naming import source_of
from dbbstation.inference.cancelling import cancelling, effects_by_name
from dbbstation.inference.verdict import Verdict

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.explain import ExplainedDrive
    from dbbstation.diagnosis.drive.held_out import DriveHeldOut
    from dbbstation.diagnosis.drive.recordings import Recordings
    from dbbstation.inference.cancelling import Cancelling
    from dbbstation.inference.verdict import Gains, Value


@dataclass(frozen=True)
class IdentifiedValue:
    """A parameter of the model.

    Attributes:
        value: with its standard uncertainty and unit.
        identifiable: False where this recording cannot tell it; the value then means nothing by itself.
    """

    value: Value
    identifiable: bool


@dataclass(frozen=True)
class DriveFinding:
    """What is said of one cause.

    Attributes:
        name: of the cause.
        verdict: what can be said.
        probability: that it is there, or one that nothing recorded here tells from it.
        ambiguous_with: causes that would explain the recording about as well in its place.
        gain: log Bayes factor of it beside the others.
        concealed: share of its signature's sum of squares that mass and viscous friction take up.
        whole_n: root mean square of its signature [N].
        rest_n: of what the base leaves of it [N].
        parameters: as fitted; for a cause that was not, best amplitudes, whose uncertainty says how much could hide.
        parts: where it is there more than once (waves, pulses, forms), each with its numbers.
        text: sentences for people.
        at_end: names of parameters that lie at the end of the values that are tried.
        complement: stretches of time that explain as much in the place of `parts`.
        gains: what it brought in held-out parts; None: not asked for.
    """

    name: str
    verdict: Verdict
    probability: float
    ambiguous_with: tuple[str, ...]
    gain: float
    concealed: float
    whole_n: float
    rest_n: float
    parameters: dict[str, Value]
    parts: tuple[DrivePart, ...]
    text: str
    at_end: tuple[str, ...] = ()
    complement: Complement | None = None
    gains: Gains | None = None

    @property
    def persists(self) -> bool:
        """Whether it happened once, such as friction that drifts, and held-out parts tell of it, too."""
        return self.verdict is Verdict.HAPPENED and self.gains is not None and self.gains.predicts


@dataclass(frozen=True)
class Complement:
    """The other way to read pulses of one size: the opposite force in the rest of the time, and a constant load.

    Attributes:
        force_n: in these stretches.
        t_s: first and last time of each [s].
        pulses: how many pulses are of that size.
    """

    force_n: Value
    t_s: tuple[tuple[float, float], ...]
    pulses: int


@dataclass(frozen=True)
class DrivePart:
    """One wave, pulse or form of a cause.

    Attributes:
        label: which; empty where there is one only.
        parameters: of it.
        t_s: first and last time of a pulse [s]; None where it is none.
    """

    label: str
    parameters: dict[str, Value]
    t_s: tuple[float, float] | None = None


@dataclass(frozen=True)
class UnmodelledForce:
    """An unmodelled force.

    Attributes:
        text: kind and variable, such as `curve over speed`.
        variable: that it follows.
        probability: that it is there.
        rms_n: of it beside mass and viscous friction [N].
        low, high: range of the variable in which it is at least half as large as anywhere.
        unit: of the variable.
    """

    text: str
    variable: str
    probability: float
    rms_n: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class DriveLocation:
    """A stretch of the recording in which a misfit stands out.

    Attributes:
        t_s: start, end [s].
        position_mm: at start and end [mm].
        direction: +1 towards greater positions, -1 the other way.
        at_reversal: a reversal or stop lies in it or beside it.
        share: of the misfit's sum of squares.
        peak_n: greatest deviation, measured minus model [N].
    """

    t_s: tuple[float, float]
    position_mm: tuple[float, float]
    direction: int
    at_reversal: bool
    share: float
    peak_n: float


@dataclass(frozen=True)
class DriveStep:
    """A model on the way from the base to the last one, and how it predicts the stretch that was held back.

    Attributes:
        added: cause that this step adds; empty for the base.
        relative_force_error: |F - F_model| / |F| on the stretch, fitted without it.
        fitted_error: the same on what was fitted.
        parameters: values fitted without the stretch, by name.
    """

    added: str
    relative_force_error: float
    fitted_error: float
    parameters: dict[str, float]


@dataclass(frozen=True)
class Rest:
    """The unmodelled residual.

    Attributes:
        rms_n: beyond noise [N].
        probability: of such a rest or a larger one by noise alone.
        variable: what organises it; None where nothing does clearly.
        effects: without a name that the comparison found, largest first.
        text: one sentence for people.
    """

    rms_n: float
    probability: float
    variable: str | None
    effects: tuple[UnmodelledForce, ...]
    text: str


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Friction against speed, all causes that hang on the speed together.

    Attributes:
        speed_m_s: shape (c,) [m/s].
        force_n: friction and constant load at that speed [N].
        uncertainty_n: standard uncertainty [N].
    """

    speed_m_s: NDArray[np.float64]
    force_n: NDArray[np.float64]
    uncertainty_n: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DriveDiagnosis:
    """Everything found.

    Attributes:
        explained: channel, comparison and fits.
        mismatch: the recording differs from the base model beyond noise.
        misfit_rms_n: of the base model beyond noise [N].
        probability: of such a misfit by chance.
        before: parameters of the base model.
        after: of the last model, base parameters first.
        friction: Coulomb and viscous friction per direction, `forwards` and `backwards`; empty where not identifiable.
        chosen: causes in the last model, those first that move the force most beside mass and viscous friction.
        vague: causes that were fitted beside it and are not in it, since they are ambiguous and no named cause stands for them.
        base_n: force of the base model at the samples compared, shape (m,) [N].
        model_n: of the last model [N].
        whole_n: of the last model with the forces that have no name [N].
        held_back_s: start and end of the stretch that was held back [s].
        steps: from the base to the last model.
        locations: of the base model's misfit, largest share first.
        findings: best first.
        rest: the residual.
        rest_locations: where, largest share first.
        cannot_tell: sentences.
        held_out: predictions of parts that took no part; None: not asked for.
        curve: friction against speed.
    """

    explained: ExplainedDrive
    mismatch: bool
    misfit_rms_n: float
    probability: float
    before: dict[str, IdentifiedValue]
    after: dict[str, IdentifiedValue]
    friction: dict[str, dict[str, Value]]
    chosen: tuple[str, ...]
    vague: tuple[str, ...]
    base_n: NDArray[np.float64]
    model_n: NDArray[np.float64]
    whole_n: NDArray[np.float64]
    held_back_s: tuple[float, float]
    steps: tuple[DriveStep, ...]
    locations: tuple[DriveLocation, ...]
    findings: tuple[DriveFinding, ...]
    rest: Rest
    rest_locations: tuple[DriveLocation, ...]
    cannot_tell: tuple[str, ...]
    curve: FrictionCurve
    held_out: DriveHeldOut | None = None

    @property
    def recordings(self) -> Recordings:
        """What was recorded."""
        return self.explained.drive.recordings

    @property
    def force_n(self) -> NDArray[np.float64]:
        """In the band, shape (m,) [N]."""
        return self.recordings.force_n

    @property
    def cancelling(self) -> Cancelling | None:
        """Forces of mass, friction and causes that cancel each other [N]; None where none do."""
        settled, drive = self.explained.settled, self.explained.drive
        base, patterns = settled.channel.base, settled.bank.patterns
        shown = {name: source_of(drive, patterns, name) for name in settled.best.names}
        forces = zip(base.names, settled.base_values(), strict=True)
        of_base = {name: base.samples[:, k] * value for k, (name, value) in enumerate(forces)}
        return cancelling(effects_by_name(settled, shown) | of_base)

    def table(self) -> dict[str, NDArray[np.float64]]:
        """What was compared, sample by sample in the band, by column name with its unit."""
        recordings = self.recordings
        return {
            "t_s": recordings.time_s,
            "position_mm": 1e3 * recordings.at(lambda s: s.position_m),
            "speed_mm_s": 1e3 * recordings.motion[:, 1],
            "acceleration_mm_s2": 1e3 * recordings.motion[:, 0],
            "force_n": self.force_n,
            "base_force_n": self.base_n,
            "model_force_n": self.model_n,
        }
