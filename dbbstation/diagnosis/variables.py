"""Variables that causes of circles follow, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.sources.contract import ErrorSource

SESSION_TIME = "the time of the session"
"""Variable of what warms up or drifts over a session: tests that were held back lie between others."""


def variable_of(source: ErrorSource) -> str:
    """Return what a named cause follows: its own name where it is no single variable."""
    return SESSION_TIME if source.varies_with == "time" else source.varies_with or source.name
