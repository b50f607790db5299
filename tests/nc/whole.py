"""A compensated path as one toolpath."""

from __future__ import annotations

from dbbstation.nc.compensate import Compensation, compensated_parts
from dbbstation.nc.toolpath import joined


def compensate_toolpath(toolpath, model, **how) -> Compensation:
    """Return `compensated_parts` together."""
    parts = list(compensated_parts(toolpath, model, **how))
    return Compensation.together(parts, joined([part.toolpath for part in parts]))
