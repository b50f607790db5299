"""Sessions with their diagnosis, by one call."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.sources.registry import known_sources
from dbbstation.tasks.diagnosed import Diagnosed, diagnosed_of
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path


def diagnose_sessions(
    paths: Sequence[Path],
    candidates: Sequence[str] | None,
    exclude: Sequence[str],
    say: Callable[[str], None],
) -> Diagnosed:
    """Read sessions of one machine and find physics beyond a kinematic calibration.

    Raises:
        InputError: faults of files and traces.
        ModelError: an unknown source, or one that is no cause.
        CalibrationError: the kinematic model cannot be fitted.
    """
    telling = Telling(say=lambda text: say(f"note: {text}"))
    return diagnosed_of(paths, candidates, ((), exclude), known_sources(), telling)
