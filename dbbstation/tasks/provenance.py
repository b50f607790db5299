"""Provenance of a script's outputs."""

from __future__ import annotations

from dbbstation import __version__
from dbbstation.files.inputs import inputs_so_far, virtual_so_far
from dbbstation.files.provenance import Provenance


def from_python() -> Provenance:
    """Return the provenance of a Python script's output, without command."""
    return Provenance(f"dbbstation {__version__}", "from Python", inputs_so_far(), virtual_so_far())
