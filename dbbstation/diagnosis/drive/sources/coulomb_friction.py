"""Cause: Coulomb friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.diagnosis.drive.contract import DriveSource, Form, Parameter, Texts

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.signals import Signals

COULOMB_SHARE = 0.5
"""Usual size, one standard deviation, of the force's root mean square."""


class CoulombFriction(DriveSource):
    """A force against the direction of travel that does not depend on the speed: F = F_c sign(v)."""

    name = "coulomb-friction"
    varies_with = "speed"
    texts = Texts(
        what="Dry friction of nut, bearings, seals and guides holds the drive back with the same force at every speed.",
        shows="The force jumps by twice the friction where the drive reverses; at very low speed it does not go to "
        "zero.",
        confirm="Travel to and fro at three constant speeds and plot mean force against speed: the two lines do not "
        "meet at zero.",
        cure="Check preload of nut and bearings, seals and lubrication; enter the rest as friction feed-forward in the "
        "control.",
        equation="F = F_c sign(v)",
        origin="Coulomb 1785; Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083, sec. 2",
    )

    def forms(self, signals: Signals, residual_n: NDArray[np.float64]) -> tuple[Form, ...]:  # noqa: ARG002
        """One amplitude."""
        size = Parameter(
            "coulomb_n", "N", COULOMB_SHARE * signals.scale.force_n, "force against the direction of travel"
        )
        return (Form((size,), lambda s, _: s.direction[:, None]),)

    def possible(self, values: Mapping[str, float]) -> bool:
        """Friction takes energy out."""
        return values["coulomb_n"] > 0.0
