"""Output of `diagnose --effects`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, echo, print_table
from dbbstation.text.digits import expanded_uncertainty, with_uncertainty

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.effects import CauseEffect

MOST_CAUSES = 4
"""Causes whose circles are listed beside the measured ones; the JSON has all."""


def print_effects(effects: Sequence[CauseEffect]) -> None:
    """Print causes and cures by contribution, and G measured and without each."""
    if not effects:
        echo("\nno cause contributes to these circles")
        return
    echo(
        f"\nwhat each cause contributes [µm], {EXPANDED}; G up to 30 undulations per revolution, means over the circles"
    )
    rows = [
        [
            rank,
            one.cause,
            one.verdict or "-",
            *_pair(one.g_um, one.g_u_um),
            *_pair(one.centre_um, one.centre_u_um),
            *_pair(one.workspace_um, one.workspace_u_um),
            f"{one.measured_g_um:.1f}",
            f"{one.cured_g_um:.1f}",
        ]
        for rank, one in enumerate(effects, start=1)
    ]
    print_table(["", "cause", "verdict", "G", "U", "centres", "U", "workspace", "U", "G measured", "without it"], rows)
    echo("contributions of opposing causes need not add up to the measured value")
    for rank, one in enumerate(effects, start=1):
        echo(f"{rank}. {one.cause}: {one.cure}")
    shown = effects[:MOST_CAUSES]
    echo("\ncircles as they would be if one cause were cured: G [µm]")
    circles = [
        [
            run.test,
            run.direction,
            run.repeat,
            f"{run.measured_g_um:.1f}",
            *(f"{one.runs[k].cured_g_um:.1f}" for one in shown),
        ]
        for k, run in enumerate(effects[0].runs)
    ]
    print_table(["test", "dir", "n", "measured", *(f"without {one.cause}" for one in shown)], circles)


def _pair(value: float | None, u: float | None) -> tuple[str, str]:
    if value is None:
        return "-", "-"
    return with_uncertainty(value, expanded_uncertainty(u, COVERAGE_FACTOR))
