"""By what a session is gone on with: the instrument that is remembered of it, where session and memory are of the same world."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.formats.virtual_port import time_scale_of, virtual_port
from dbbstation.files.recordings.session import read_session
from dbbstation.service.memory import Line

if TYPE_CHECKING:
    from pathlib import Path


def line_to_go_on(folder: Path, remembered: Line, given: Line) -> Line:
    """Return instrument and port for a session that exists.

    A virtual session goes on with a virtual machine, whatever the shop's settings name; a real one never does.

    Args:
        remembered: what it was measured by last, as this computer remembers.
        given: the same with what command line and settings say.
    """
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
