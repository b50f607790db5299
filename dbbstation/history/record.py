"""What a history keeps of a session and of a model."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime  # noqa: TC003 - pydantic needs it to read JSON
from math import nan


@dataclass(frozen=True)
class Figure:
    """One figure of one run.

    Attributes:
        u_um: standard uncertainty; None if not known.
    """

    name: str
    value_um: float
    u_um: float | None

    @property
    def stated_u_um(self) -> float:
        """Return the standard uncertainty [µm]; nan if unknown."""
        return nan if self.u_um is None else self.u_um


@dataclass(frozen=True)
class RunFigures:
    """Figures of one accepted run.

    Attributes:
        direction: `ccw` or `cw`.
        circle: description; runs of a test are comparable if it is equal.
    """

    test: str
    direction: str
    circle: str
    figures: tuple[Figure, ...]


@dataclass(frozen=True)
class SessionFigures:
    """One session.

    Attributes:
        name: folder relative to the history's.
        machine: serial number, or the name in its file.
        programs: hash of NC programs that replaced the plan's circles, or empty.
        anchor: hash of the log's last event, else of the last run; empty without a seal.
    """

    name: str
    sha256: str
    machine: str
    started: datetime | None
    runs: tuple[RunFigures, ...]
    bar: str = ""
    programs: str = ""
    notes: tuple[str, ...] = ()
    anchor: str = ""


@dataclass(frozen=True)
class ModelParameter:
    """One parameter of the machine in a model."""

    source: str
    name: str
    value: float
    u: float | None
    unit: str


@dataclass(frozen=True)
class ModelFigures:
    """One identified model.

    Attributes:
        sessions: SHA-256 of its session files, by name.
        warnings: to be shown with its numbers.
    """

    file: str
    sha256: str
    sessions: dict[str, str] = field(default_factory=dict)
    parameters: tuple[ModelParameter, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def sources(self) -> tuple[str, ...]:
        """Return its error sources; only models with equal sources are comparable."""
        return tuple(dict.fromkeys(parameter.source for parameter in self.parameters))
