"""Variables that causes of circles follow, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.sources.contract import ErrorSource

SESSION_TIME = "the time of the session"
"""Variable of what warms up or drifts over a session: tests that were held back lie between others."""


def variable_of(source: ErrorSource) -> str:
    """Return a named cause's variable; its own name if there is no single one."""
    return SESSION_TIME if source.varies_with == "time" else source.varies_with or source.name
