"""File names that every system accepts."""

from __future__ import annotations

DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{kind}{n}" for kind in ("com", "lpt") for n in range(1, 10))})
"""Names that Windows reserves before the first point of a file name, in any case (Microsoft, "Naming Files, Paths, and
Namespaces")."""


def is_device(name: str) -> bool:
    """Return whether Windows treats a name as a device."""
    return name.partition(".")[0].lower() in DEVICES
