"""The largest memory of this process since the last reset."""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

KB_PER_MB = 1024.0


def forget_largest_memory() -> None:
    """Reset to the memory in use now, if the system can (proc(5), `clear_refs`)."""
    _give_back_what_is_free()
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return


def _give_back_what_is_free() -> None:
    if sys.platform != "linux":
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def largest_memory_mb() -> float | None:
    """Return the largest resident memory since the reset [MB]; None if not known."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return None
    found = [line for line in status.splitlines() if line.startswith("VmHWM:")]
    return float(found[0].split()[1]) / KB_PER_MB if found else None
