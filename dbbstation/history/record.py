"""What a history knows of one session and of one model: figures with their uncertainties, and what may explain a change."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime  # noqa: TC003 - JSON is read by it
from math import nan


@dataclass(frozen=True)
class Figure:
    """One figure of one run.

    Attributes:
        name: such as `G` or `X`.
        u_um: its standard uncertainty [µm]; None where it is not known.
    """

    name: str
    value_um: float
    u_um: float | None

    @property
    def stated_u_um(self) -> float:
        """Its standard uncertainty; not a number where it is not known [µm]."""
        return nan if self.u_um is None else self.u_um


@dataclass(frozen=True)
class RunFigures:
    """Figures of one accepted run.

    Attributes:
        direction: `ccw` or `cw`.
        circle: its commanded circle in words: runs of one test are comparable where these are the same.
    """

    test: str
    direction: str
    circle: str
    figures: tuple[Figure, ...]


@dataclass(frozen=True)
class SessionFigures:
    """One session.

    Attributes:
        name: of its folder, from the folder of the history.
        machine: serial number of the machine, or the name in its machine file.
        started: start of the first accepted run; None where no run has one noted.
        runs: accepted runs that show a circle.
        bar: serial number of the bar; empty where not noted.
        programs: NC programs that were run instead of the plan's circles, as a hash over theirs; empty for none.
        anchor: link of the last event of its log; of a session without a log the end of its chain of runs; empty without a seal.
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
    """One parameter of the machine in a model.

    Attributes:
        source: name of its error source.
        u: its standard uncertainty; None where it was held or is not known.
    """

    source: str
    name: str
    value: float
    u: float | None
    unit: str


@dataclass(frozen=True)
class ModelFigures:
    """One identified model.

    Attributes:
        file: its path, from the folder of the history.
        sessions: SHA-256 of the session files that it comes from, by name.
        warnings: what has to be said of it wherever its numbers are shown.
    """

    file: str
    sha256: str
    sessions: dict[str, str] = field(default_factory=dict)
    parameters: tuple[ModelParameter, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of its error sources: a parameter is comparable with that of a model that has the same ones."""
        return tuple(dict.fromkeys(parameter.source for parameter in self.parameters))
