"""Causes of a model ranked by their contribution to circles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.text.digits import expanded_uncertainty, with_uncertainty

if TYPE_CHECKING:
    from dbbstation.diagnosis.effects import CauseEffect


@dataclass(frozen=True, eq=False)
class Ranked:
    """Causes shown with the circles.

    Attributes:
        why_not: reason if there are no causes; else empty.
        said: the model's diagnosis in two sentences; may be empty.
        picture: the diagnosis's errors in held-out tests as lines of a picture; may be empty.
    """

    session: str = ""
    effects: tuple[CauseEffect, ...] = ()
    why_not: str = ""
    said: tuple[str, ...] = ()
    picture: tuple[str, ...] = ()


def told_causes(ranked: Ranked, coverage_factor: float) -> tuple[str, ...]:
    """Return a sentence for each cause with its cure, in order of contribution."""
    told = []
    for rank, one in enumerate(ranked.effects, start=1):
        g, g_u = with_uncertainty(one.g_um, expanded_uncertainty(one.g_u_um, coverage_factor))
        centre, _ = with_uncertainty(one.centre_um, expanded_uncertainty(one.centre_u_um, coverage_factor))
        known = "" if g_u == "-" else f", U {g_u} µm"
        told.append(
            f"Cause {rank}, {one.cause}: {g} µm of G{known}, {centre} µm of the centres. {one.cure[0].upper()}{one.cure[1:].rstrip('.')}."
        )
    return tuple(told)
