"""Tasks on a measured session, in a form for another process."""

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
    """What is to be done."""
    beside: Path
    """Folder in which the shop's settings are looked for."""
    out: str
    """Name of what is written, in the folder of results."""
    session: Path | None = None
    """Folder of the session; programs need none."""
    before: Path | None = None
    """Session that an acceptance holds it against."""
    model: Path | None = None
    """Model to compensate with, or to put beside; None: nominal programs, or no model."""
    plan: Path | None = None
    """Plan of the programs."""
    machine: Path | None = None
    """Machine of the programs."""
    settings: Path | None = None
    """File of the shop's settings where one was named."""
    tolerances: Path | None = None
    """Settings with the tolerances of an operator's job, in place of the shop's."""
    place: str = ""
    """Where was measured, for a certificate."""
    force: bool = True
    """Whether what is there already is written over: the folder of results is the program's own."""
