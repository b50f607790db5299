"""What the page of a report shows beside its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.files.provenance import Provenance
    from dbbstation.quality.finding import Finding
    from dbbstation.report.causes_part import CauseRow, TitledPolar
    from dbbstation.report.plate_map import MapPlace


@dataclass(frozen=True, eq=False)
class ShownSession:
    """A session as the page shows it.

    Attributes:
        identity: what machine, bar and the like are, each with its name.
        known: whether the places of the balls are.
    """

    name: str
    measured: str
    identity: Sequence[tuple[str, str]]
    conditions: Sequence[tuple[str, str]]
    places: Sequence[MapPlace]
    known: bool


@dataclass(frozen=True, eq=False)
class ShownCauses:
    """Causes as the page shows them.

    Attributes:
        session: whose circles they act on.
        why_not: why there are none; empty where there are.
        polars: circles without the first cause.
    """

    session: str
    why_not: str
    rows: Sequence[CauseRow]
    polars: Sequence[TitledPolar]


@dataclass(frozen=True)
class ShownFindings:
    """Findings as the page shows them.

    Attributes:
        wrong: session, run and finding of each that is beyond its limit.
        undecided: name, text and runs of those that cannot be decided.
        good: how many keep their limits.
    """

    wrong: Sequence[tuple[str, str, Finding]]
    undecided: Sequence[tuple[str, str, Sequence[str]]]
    good: int


@dataclass(frozen=True, eq=False)
class ShownModel:
    """A model as the page shows it.

    Attributes:
        problem: why it could not be evaluated; empty where it could.
        failed: whether physics is missing from it.
        parameters: rows of their table.
    """

    problem: str
    failed: bool
    quality: str
    parameters: Sequence[tuple[str, str, str, str, str]]
    not_visible: Sequence[str]


@dataclass(frozen=True, eq=False)
class ReportContent:
    """What the template of a report names beside its numbers.

    Attributes:
        virtual: names of sessions of a virtual machine.
        reasons_shown: how many reasons of the verdict the first page has.
        ranking: causes; None without a model.
        before_name: session that was measured before; empty for none.
        several: whether there is more than one session.
        modelled: a model beside the circles; None for none.
        files: name and SHA-256 of every file that the report rests on.
    """

    machine: str
    virtual: Sequence[str]
    job: str
    sessions: Sequence[ShownSession]
    reasons_shown: int
    map_width: float
    polar_size: float
    polar_radius: float
    polars: Sequence[TitledPolar]
    ranking: ShownCauses | None
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
