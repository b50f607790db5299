"""The largest memory that this process has had, since it was last forgotten."""

from __future__ import annotations

from pathlib import Path

KB_PER_MB = 1024.0


def forget_largest_memory() -> None:
    """Begin anew with what the process has now; nothing happens where the system cannot (proc(5), `clear_refs`)."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return


def largest_memory_mb() -> float | None:
    """Largest resident memory since it was forgotten, or since the process began [MB]; None where the system does not say."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return None
    found = [line for line in status.splitlines() if line.startswith("VmHWM:")]
    return float(found[0].split()[1]) / KB_PER_MB if found else None
