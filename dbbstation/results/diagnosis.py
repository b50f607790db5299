"""The result of `diagnose`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import computed_field

from dbbstation.calibration.outliers.outlier import Outlier
from dbbstation.diagnosis.effects import CauseEffect
from dbbstation.diagnosis.findings import Location, NextTest, Shift, SourceFinding, Unexplained
from dbbstation.diagnosis.workspace import WorkspaceError
from dbbstation.facts.by_name import ByName
from dbbstation.facts.run import OfRun
from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.files.formats.model import write_model
from dbbstation.files.provenance import Provenance
from dbbstation.inference.cancelling import Cancelling
from dbbstation.inference.levels import Levels
from dbbstation.inference.limit_reached import LimitReached
from dbbstation.model.identified import IdentifiedModel
from dbbstation.results.frame import Framed
from dbbstation.results.levels_text import level_sentences, short_sentences


@dataclass(frozen=True)
class BeforeAfter:
    """A figure with the kinematic calibration (before) and with the joint model (after)."""

    before: float
    after: float


@dataclass(frozen=True)
class CircularityLeft(OfRun):
    """Residual circularity of one run [µm]."""

    before: float
    after: float


@dataclass(frozen=True, kw_only=True, eq=False)
class DiagnosisFigures(Framed):
    """Results of a diagnosis: kinematic calibration `before`, joint model `after`.

    Attributes:
        mismatch: whether recordings contradict the kinematic model.
        probability: of that misfit by chance.
        held_out: `tested`, or `not-tested` for too few tests.
        held_out_worse: whether predictions get worse; None if not tested.
        second_start_agrees: whether a second search agrees; None without one.
        limits: search, parameters and joint fit that ended at a limit.
        levels: existence, variables and cause of a difference.
    """

    mismatch: bool
    probability: float
    noise_um: float
    misfit_rms_um: float
    residual_rms_um: BeforeAfter
    held_out_rms_um: BeforeAfter
    held_out_normalised: BeforeAfter
    held_out: str
    held_out_worse: bool | None
    circularity_um: tuple[CircularityLeft, ...]
    workspace: WorkspaceError | None
    outliers: tuple[Outlier, ...]
    locations: tuple[Location, ...]
    sources: ByName[SourceFinding]
    cancelling: Cancelling | None
    unexplained: Unexplained
    parameter_shift: tuple[Shift, ...]
    second_start_agrees: bool | None
    next_test: NextTest | None
    further_tests: tuple[NextTest, ...]
    levels: Levels
    limits: tuple[LimitReached, ...] = ()

    def sentences(self) -> list[str]:
        """Return the answer in three levels, in words."""
        values = {one.name: one.parameters for one in self.sources}
        what = "Measured circles and the kinematic model"
        return level_sentences(self.levels, "µm", values, rows="tests", what=what)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def said(self) -> tuple[str, ...]:
        """Return two sentences for a report or a screen: whether a difference exists, and its main variable."""
        return short_sentences(self.levels, "µm", "Measured circles and the kinematic model")

    @property
    def identified(self) -> tuple[SourceFinding, ...]:
        """Return causes with the verdict `identified`."""
        return tuple(one for one in self.sources if one.verdict == "identified")

    def headline(self) -> str:
        """Return the misfit and the identified causes."""
        named = ", ".join(one.name for one in self.identified) or "nothing"
        if not self.mismatch:
            return f"the recordings agree with the kinematic model, {self.noise_um:.2f} µm noise"
        return f"misfit {self.misfit_rms_um:.2f} µm rms beyond noise; identified: {named}"

    def rows(self) -> list[dict[str, object]]:
        """Return one row per cause."""
        return [
            {
                "cause": one.name,
                "verdict": one.verdict,
                "probability": one.probability,
                "log_bayes_factor": one.gain,
                "concealed": one.concealed,
            }
            for one in self.sources
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class DiagnosisResult(DiagnosisFigures):
    """The result of a diagnosis."""

    effects: tuple[CauseEffect, ...]
    model: Annotated[IdentifiedModel, AsItIs, Kept] = field(repr=False)
    recorded: Annotated[Any, AsItIs, Kept] = field(default=None, repr=False)

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:
        write_model(path, self.model, provenance=provenance, force=force)
