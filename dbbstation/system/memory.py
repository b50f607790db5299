"""The largest memory that this process has had, since it was last forgotten."""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

KB_PER_MB = 1024.0


def forget_largest_memory() -> None:
    """Begin anew with what the process has in use now; nothing happens where the system cannot (proc(5), `clear_refs`)."""
    _give_back_what_is_free()
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return


def _give_back_what_is_free() -> None:
    """Give the pages back that the C library keeps of what was freed (malloc_trim(3)); other libraries do it by themselves, or cannot."""
    if sys.platform != "linux":
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def largest_memory_mb() -> float | None:
    """Largest resident memory since it was forgotten, or since the process began [MB]; None where the system does not say."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return None
    found = [line for line in status.splitlines() if line.startswith("VmHWM:")]
    return float(found[0].split()[1]) / KB_PER_MB if found else None
