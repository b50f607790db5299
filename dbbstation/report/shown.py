"""The content of the report page other than numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import date

    from dbbstation.files.provenance import Provenance
    from dbbstation.quality.finding import Finding
    from dbbstation.report.plate_map import MapPlace
    from dbbstation.report.polar import TitledPolar
    from dbbstation.results.report_verdict import Ranked


@dataclass(frozen=True, eq=False)
class ShownSession:
    """Texts of a session for the page."""

    name: str
    measured: str
    serial: str
    identity: Sequence[tuple[str, str]]
    conditions: Sequence[tuple[str, str]]
    places: Sequence[MapPlace]
    known: bool


@dataclass(frozen=True)
class ShownFindings:
    """Texts of the findings for the page."""

    wrong: Sequence[tuple[str, str, Finding]]
    undecided: Sequence[tuple[str, str, Sequence[str]]]
    good: int


@dataclass(frozen=True, eq=False)
class ShownModel:
    """Texts of a model for the page."""

    problem: str
    failed: bool
    quality: str
    parameters: Sequence[tuple[str, str, str, str, str]]
    not_visible: Sequence[str]


@dataclass(frozen=True)
class ShownBudget:
    """Standard uncertainties of one circle [µm], a row for each cause and a column for each figure."""

    run: str
    figures: Sequence[str]
    rows: Sequence[tuple[str, Sequence[float | None]]]


@dataclass(frozen=True, eq=False)
class ReportContent:
    """Content of the report's template.

    Attributes:
        number: of the report, computed from program, command and inputs.
        issued: local date on which it was written.
        before_name: earlier session; may be empty.
        files: name and SHA-256 of every underlying file.
        logo: address of the picture with its content; may be empty.
    """

    machine: str
    number: str
    issued: date
    virtual: Sequence[str]
    job: str
    sessions: Sequence[ShownSession]
    reasons_shown: int
    map_width: float
    polar_size: float
    polar_radius: float
    polars: Sequence[TitledPolar]
    ranking: Ranked | None
    cured: Sequence[TitledPolar]
    before_name: str
    several: bool
    findings: ShownFindings
    not_stated: Sequence[str]
    why_not: Sequence[str]
    tolerances_from: str
    modelled: ShownModel | None
    notes: Sequence[str]
    files: Sequence[tuple[str, str]]
    provenance: Provenance
    laboratory: str
    customer: str
    logo: str
    budget: ShownBudget | None
