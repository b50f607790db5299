"""Play between drive and load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts
from dbbstation.diagnosis.drive.sources.coulomb_friction import MOST_OF_COULOMB

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.signals import Signals

GAPS = (0.002, 0.004, 0.008, 0.016, 0.03, 0.06, 0.12, 0.24)
"""Tried plays, over the travel."""

RISES = (0.25, 1.0, 2.0)
"""Tried travels over which the load returns, over the play."""


class LostMotion(DriveSource):
    """After a reversal the load is missing until the play is crossed: F = -F_l sign(v) r(d).

    r is 1 within the travel g, then falls to 0 over w. If F_l equals the Coulomb friction, all friction is behind the
    play.
    """

    name = "lost-motion"
    varies_with = "travel since reversal"
    form_uncertainty = 0.2  # contacts close gradually, and play is seldom the same at both ends of a travel
    texts = Texts(
        what="Between drive and load there is play or an elastic lash: after a reversal the drive moves over it before "
        "the load, or its friction, is felt.",
        shows="After every reversal the force stays near zero over the same travel before it rises to its new level.",
        confirm="Reverse slowly and read force over position: a flat stretch near zero force of the same length at both "
        "ends; measure the load itself with a dial gauge.",
        cure="Preload nut and couplings; replace worn joints; backlash compensation in the control.",
        equation="F = -F_l sign(v) r(d), r = 1 for d < g, then falling to 0 over w, d the travel since the reversal",
        origin="Nordin and Gutman, Controlling mechanical systems with backlash, Automatica 38 (2002) 1633, sec. 2",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        if not (scale.reverses and scale.both_ways):
            return ()
        size = Parameter("lost_n", "N", 0.5 * scale.force_n, "force that is missing within the play", positive=True)
        gaps = tuple(1e3 * share * scale.travel_m for share in GAPS)
        gap = Parameter("gap_mm", "mm", 1e3 * 0.03 * scale.travel_m, "play", gaps)
        rise = Parameter("rise_per_gap", "1", 1.0, "way over which the load comes back, over the play", RISES)
        return (DriveForm((size, gap, rise), _columns),)

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        return values["lost_n"] <= MOST_OF_COULOMB * max(values.get("coulomb_n", 0.0), 0.0)


def _columns(signals: Signals, shape: tuple[float, ...]) -> Floats:
    gap_mm, rise = shape
    since = 1e3 * signals.since_reversal_m
    missing = np.clip((gap_mm * (1.0 + rise) - since) / (gap_mm * rise), 0.0, 1.0)
    return -(signals.direction * missing)[:, None]
