"""A force that grows with position."""

from __future__ import annotations

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts


class Stiffness(DriveSource):
    """A spring: F = k (x - x_m), x_m the mean position."""

    name = "stiffness"
    varies_with = "position"
    form_uncertainty = 0.05  # springs, hoses and cable chains are straight to some 5 %
    texts = Texts(
        what="A spring acts along the drive: a bellows, a cable chain, a hose, a weight balance, or a weight whose "
        "share along the strut changes with its length.",
        shows="The force rises or falls along the travel by the same amount forwards and backwards.",
        confirm="Stop at five places, reverse briefly at each and take the mean of the forces of both directions.",
        cure="Take the spring off or lead the cable another way; otherwise enter it as a feed-forward over position.",
        equation="F = k (x - x_m)",
        origin="Hooke; stiffness of inverse dynamic models in Gautier and Khalil, IEEE TRA 6 (1990) 368",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        size = Parameter(
            "stiffness_n_mm",
            "N/mm",
            1e-3 * 0.6 * scale.force_n / scale.travel_m,
            "force per travel, positive: a spring",
        )
        middle = scale.mean_m
        return (DriveForm((size,), lambda s, _: 1e3 * (s.position_m - middle)[:, None]),)
