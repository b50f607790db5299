"""Friction that builds up after a reversal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts
from dbbstation.diagnosis.drive.sources.coulomb_friction import MOST_OF_COULOMB

if TYPE_CHECKING:
    from collections.abc import Mapping


SHARES = (0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.03, 0.06)
"""Tried lengths of the build-up, over the travel."""


class Presliding(DriveSource):
    """Friction reverses over a travel: F = -2 F_p sign(v) exp(-d / d_0).

    With Coulomb friction F_p it is Dahl's F = F_c sign(v) (1 - 2 exp(-d / d_0)), d since the reversal.
    """

    name = "presliding"
    varies_with = "travel since reversal"
    form_uncertainty = 0.2  # friction builds up only approximately exponentially
    texts = Texts(
        what="Contacts, balls and seals yield elastically before they slide: after a reversal friction turns round "
        "over a short travel, not at once.",
        shows="After every reversal the force approaches its new level along the travel, at slow and at fast reversals "
        "over the same travel.",
        confirm="Reverse slowly at one place with strokes of 0.05 to 1 mm and plot force over position: loops that are "
        "rounded at their corners.",
        cure="A stiffer support of seals and bearings; in the control a reversal compensation that depends on travel.",
        equation="F = -2 F_p sign(v) exp(-d / d_0), d the travel since the reversal",
        origin="Dahl, A solid friction model, Aerospace Corporation TOR-158 (1968); Armstrong-Hélouvry, Dupont and "
        "Canudas de Wit, Automatica 30 (1994) 1083",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        if not scale.reverses:
            return ()
        size = Parameter(
            "presliding_n", "N", 0.2 * scale.force_n, "friction still to turn round at reversal", positive=True
        )
        lengths = tuple(1e3 * share * scale.travel_m for share in SHARES)
        meaning = "travel after which 37 % are left of it"
        length = Parameter("length_mm", "mm", 1e3 * 0.01 * scale.travel_m, meaning, lengths)
        return (
            DriveForm(
                (size, length),
                lambda s, shape: (-2.0 * s.direction * np.exp(-1e3 * s.since_reversal_m / shape[0]))[:, None],
            ),
        )

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        return values["presliding_n"] <= MOST_OF_COULOMB * max(values.get("coulomb_n", 0.0), 0.0)
