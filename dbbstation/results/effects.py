"""What each cause of a model contributes to circles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.facts.run import OfRun

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.diagnosis.effects import CauseEffect, CuredCircle


@dataclass(frozen=True, kw_only=True)
class CuredRun(OfRun):
    """One run with and without a cause; G up to 30 undulations per revolution."""

    g_um: float
    centre_um: tuple[float, ...]
    measured_g_um: float
    cured_g_um: float
    measured_centre_um: tuple[float, ...]
    cured_centre_um: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class CauseContribution:
    """A cause's contribution over all runs.

    Attributes:
        cause: source, or `geometry` for all kinematic parameters.
        verdict: empty for geometry or without diagnosis.
        g_um: mean circular deviation of the cause alone.
        workspace_um: rms tool shift over the workspace about a common shift; None if it follows more than the pose.
    """

    cause: str
    sources: tuple[str, ...]
    verdict: str
    g_um: float
    g_u_um: float | None
    centre_um: float
    centre_u_um: float | None
    workspace_um: float | None
    workspace_u_um: float | None
    measured_g_um: float
    cured_g_um: float
    cure: str
    confirm: str
    runs: tuple[CuredRun, ...]


def effect_results(effects: Sequence[CauseEffect], verdicts: Mapping[str, str]) -> tuple[CauseContribution, ...]:
    """Return causes by contribution."""
    return tuple(_result(one, verdicts.get(one.name, "")) for one in effects)


def _result(one: CauseEffect, verdict: str) -> CauseContribution:
    count = len(one.circles)
    return CauseContribution(
        cause=one.name,
        sources=one.sources,
        verdict=verdict,
        g_um=one.g_um,
        g_u_um=one.g_u_um,
        centre_um=one.centre_um,
        centre_u_um=one.centre_u_um,
        workspace_um=one.workspace_um,
        workspace_u_um=one.workspace_u_um,
        measured_g_um=sum(circle.measured_g_um for circle in one.circles) / count,
        cured_g_um=sum(circle.cured_g_um for circle in one.circles) / count,
        cure=one.cure,
        confirm=one.confirm,
        runs=tuple(_run(circle) for circle in one.circles),
    )


def _run(circle: CuredCircle) -> CuredRun:
    return CuredRun(
        test=circle.test,
        direction=circle.direction,
        repeat=circle.repeat,
        g_um=circle.g_um,
        centre_um=tuple(circle.centre_um.tolist()),
        measured_g_um=circle.measured_g_um,
        cured_g_um=circle.cured_g_um,
        measured_centre_um=tuple(circle.measured_centre_um.tolist()),
        cured_centre_um=tuple(circle.cured_centre_um.tolist()),
    )
