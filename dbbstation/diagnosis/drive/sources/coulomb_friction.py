"""Coulomb friction."""

from __future__ import annotations

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts

COULOMB_SHARE = 0.5
"""Usual size, one standard deviation, relative to the force's rms."""

MOST_OF_COULOMB = 1.5
"""Largest friction after a reversal over Coulomb friction: 2.5 standard deviations of the formula's inaccuracy."""


class CoulombFriction(DriveSource):
    """Friction independent of speed: F = F_c sign(v)."""

    name = "coulomb-friction"
    varies_with = "speed"
    form_uncertainty = 0.05  # friction of guides and seals scatters along the travel by some 5 % of its mean
    prior_probability = 0.5  # every drive with seals, nut or guides has it; it matters in half of them
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

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        size = Parameter(
            "coulomb_n", "N", COULOMB_SHARE * scale.force_n, "force against the direction of travel", positive=True
        )
        return (DriveForm((size,), lambda s, _: s.direction[:, None]),)
