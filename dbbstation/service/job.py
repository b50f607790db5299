"""Tasks on a measured session, as data for another process."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

from pydantic import BaseModel, ConfigDict


class SessionTask(StrEnum):
    """Tasks in their usual order."""

    CALIBRATE = "calibrate"
    DIAGNOSE = "diagnose"
    PROGRAMS = "programs"
    REPORT = "report"
    ACCEPTANCE = "acceptance"
    FIGURES = "figures"
    HISTORY = "history"


class SessionJob(BaseModel):
    """One task on one session."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    task: SessionTask
    """The task."""
    beside: Path
    """Folder that may contain the shop's settings."""
    out: str
    """Name of the output in the folder of results."""
    session: Path | None = None
    """Folder of the session; programs need none."""
    before: Path | None = None
    """Earlier session for the comparison of an acceptance."""
    model: Path | None = None
    """Model for compensation or comparison; None: nominal programs, or no model."""
    plan: Path | None = None
    """Plan of the programs."""
    machine: Path | None = None
    """Machine of the programs."""
    settings: Path | None = None
    """File of the shop's settings, if one was named."""
    tolerances: Path | None = None
    """Settings with the tolerances of an operator's job, which replace the shop's."""
    place: str = ""
    """Place of the measurement, for a certificate."""
    force: bool = True
    """Whether existing files are replaced: only the program writes into the folder of results."""
