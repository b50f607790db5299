"""Friction that grows faster than speed."""

from __future__ import annotations

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts

POWERS = (1.5, 2.0, 2.5, 3.0)
"""Tried powers. At few speeds, powers below 1 cannot be distinguished from Coulomb plus viscous friction; unnamed
shapes cover them."""


class PowerLawFriction(DriveSource):
    """Beyond viscous friction: F = F_p sign(v) (|v| / v_max)^a."""

    name = "power-law-friction"
    varies_with = "speed"
    form_uncertainty = 0.1  # churning and windage follow powers roughly
    texts = Texts(
        what="Friction grows faster than the speed: oil is churned, air or coolant is displaced, a cover flutters.",
        shows="Force against constant speed bends away from the axis of speed, for both directions alike.",
        confirm="Travel at five or more constant speeds up to the rapid; plot mean force against speed, cold and warm.",
        cure="Another lubricant or less of it; open the way for what is displaced; enter the curve as a feed-forward.",
        equation="F = F_p sign(v) (|v| / v_max)^a, a = 1.5 ... 3, v_max the greatest speed of the recording",
        origin="Olsson, Åström, Canudas de Wit, Gäfvert and Lischinsky, Friction models and friction compensation, "
        "European Journal of Control 4 (1998) 176, sec. 2",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        size = Parameter(
            "at_greatest_speed_n", "N", 0.2 * scale.force_n, "friction at the greatest speed", positive=True
        )
        power = Parameter("power", "1", 1.0, "exponent of the speed", POWERS)
        top = scale.speed_m_s

        return (
            DriveForm((size, power), lambda s, shape: (s.direction * (np.abs(s.speed_m_s) / top) ** shape[0])[:, None]),
        )
