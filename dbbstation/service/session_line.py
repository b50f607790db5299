"""The instrument to continue a session with, both real or both virtual."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.formats.virtual_port import time_scale_of, virtual_port
from dbbstation.files.recordings.session import read_session
from dbbstation.service.memory import Line

if TYPE_CHECKING:
    from pathlib import Path


def line_to_go_on(folder: Path, remembered: Line, given: Line) -> Line:
    """Return instrument and port for an existing session."""
    try:
        session = read_session(folder)
    except InputError:  # what is wrong with it is said where it is opened
        return given
    if session.virtual:
        noted = session.instrument
        if remembered.virtual or noted is None:
            return remembered if remembered.virtual else given
        port = noted.port if time_scale_of(noted.port) is not None else virtual_port()
        return Line(instrument=noted.name, profile=noted.profile, port=port)
    if session.runs and given.virtual:
        return given.model_copy(update={"port": "", "baud": None})
    return given
