"""Names of variables that causes of circles follow."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.sources.contract import ErrorSource

SESSION_TIME = "the time of the session"
"""Variable of warm-up and drift over a session, in which held-out tests are between others."""


def variable_of(source: ErrorSource) -> str:
    """Return a named cause's variable; its own name without a single variable."""
    return SESSION_TIME if source.varies_with == "time" else source.varies_with or source.name
