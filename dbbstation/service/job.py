"""Tasks on a measured session, as data for another process."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

from pydantic import BaseModel, ConfigDict


class SessionTask(StrEnum):
    """Steps after a session in their usual order."""

    CALIBRATE = "calibrate"
    DIAGNOSE = "diagnose"
    PROGRAMS = "programs"
    REPORT = "report"
    ACCEPTANCE = "acceptance"
    FIGURES = "figures"
    HISTORY = "history"


class Call(BaseModel):
    """One task with its parameters and outputs, as the command of this name has them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    task: str
    """Name of the command."""
    given: dict[str, str]
    """Values by parameter; what is missing comes from the settings."""
    outputs: dict[str, str] = {}
    """Files to write, by the option that names them on the command line."""
    beside: Path
    """Folder that may contain the shop's settings."""
    settings: Path | None = None
    """File of the shop's settings, if one was named."""
    tolerances: Path | None = None
    """Settings with the tolerances of an operator's job, which replace the shop's."""
    force: bool = True
    """Whether existing files are replaced: only the program writes into the folder of results."""
