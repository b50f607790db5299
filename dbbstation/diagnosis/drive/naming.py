"""The causes of members, and whether they are single events."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.inference.patterns import Family
from dbbstation.inference.verdict import Acts

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.diagnosis.drive.channel import DriveChannel
    from dbbstation.inference.patterns import Pattern

COULOMB, COGGING, TRANSIENT = "coulomb-friction", "cogging", "transient-force"
"""Causes with additional results: friction at one speed, waves over position, stretches of time."""

DRIFT = "friction-drift"


def source_of(drive: DriveChannel, patterns: Mapping[str, Pattern], name: str) -> str:
    """Return a member's source; empty for patterns."""
    if name in drive.of_law:
        return drive.of_law[name][0].name
    pattern = patterns.get(name)
    if pattern is None:
        return ""
    if pattern.family is Family.PULSES:
        return TRANSIENT if TRANSIENT in drive.sources else ""
    if pattern.family is Family.WAVE and [variable.name for variable in pattern.variables] == ["position"]:
        return COGGING if COGGING in drive.sources else ""
    return ""


def acts(source: str) -> Acts:
    """Return whether a cause is a single event, as forces in time and drift."""
    return Acts.ONCE if source in {TRANSIENT, DRIFT} else Acts.ALWAYS
