"""The result of `sources`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.calibration.fit.calibrate import default_sources
from dbbstation.facts import of_facts
from dbbstation.facts.serialise import Absent
from dbbstation.machine.geometry import Machine
from dbbstation.sources.contract import ErrorSource


@dataclass(frozen=True)
class SourceParameter:
    """A parameter of a cause."""

    name: str
    unit: str
    usual_size: float
    meaning: str


@dataclass(frozen=True)
class SourceDescription:
    """A cause's description.

    Attributes:
        role: always fitted, candidate of the diagnosis, or holder of a curve.
        varies_with: variable that real machines' departure from the formula follows; None: the pose.
        form_uncertainty: size of that departure as a share of the effect, one standard deviation.
    """

    name: str
    belongs_to: str
    role: str
    what: str
    shows: str
    confirm: str
    cure: str
    equation: str
    origin: str
    needs: tuple[str, ...]
    varies_with: str | None
    form_uncertainty: float
    parameters: Annotated[tuple[SourceParameter, ...] | None, Absent] = None


@dataclass(frozen=True)
class SourcesResult:
    """All known causes."""

    sources: tuple[SourceDescription, ...]


def source_description(source: ErrorSource, machine: Machine | None = None) -> SourceDescription:
    """Describe a cause, with parameters if a machine is given.

    Raises:
        ModelError: the machine lacks what the source needs.
    """
    parameters = None
    if machine is not None:
        parameters = tuple(SourceParameter(p.name, p.unit, p.plausible, p.meaning) for p in source.parameters(machine))
    return of_facts(
        SourceDescription,
        source.texts,
        source,
        belongs_to=source.belongs_to.value,
        role=role_of(source),
        needs=tuple(sorted(need.value for need in source.needs)),
        varies_with=source.varies_with or None,
        parameters=parameters,
    )


def role_of(source: ErrorSource) -> str:
    """Return a cause's role: always fitted, candidate of the diagnosis, or holder of a curve."""
    if source.name in {fitted.name for fitted in default_sources()}:
        return "fitted always"
    return "candidate" if source.candidate else "keeps what has no name"
