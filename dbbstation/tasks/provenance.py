"""Where outputs come from that a script asked for."""

from __future__ import annotations

from dbbstation import __version__
from dbbstation.files.inputs import inputs_so_far
from dbbstation.files.provenance import Provenance


def from_python() -> Provenance:
    """Return the provenance of an output that a Python script asked for: its command is not known."""
    return Provenance(f"dbbstation {__version__}", "from Python", inputs_so_far())
