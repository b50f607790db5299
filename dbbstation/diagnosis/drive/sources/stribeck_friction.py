"""Friction that falls with speed near standstill."""

from __future__ import annotations

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts

SHARES = (0.02, 0.04, 0.07, 0.1, 0.14, 0.2, 0.28)
"""Tried Stribeck speeds, over the greatest speed; above a fifth the curve is not limited to low speed."""


class StribeckFriction(DriveSource):
    """Static friction above Coulomb: F = F_s sign(v) exp(-|v| / v_s)."""

    name = "stribeck-friction"
    varies_with = "speed"
    form_uncertainty = 0.1  # exponentials, Gaussians and rational functions of speed are all used
    texts = Texts(
        what="Near standstill friction is greater than at speed, because no film of lubricant carries yet.",
        shows="Force peaks where the drive starts and reverses; at very low speed the drive stutters.",
        confirm="Travel at five constant speeds between creeping and a fifth of the rapid: the force falls with the "
        "speed before it rises.",
        cure="Another lubricant or lubrication interval, less preload; friction compensation in the control.",
        equation="F = F_s sign(v) exp(-|v| / v_s)",
        origin="Stribeck 1902; Tustin 1947; Bo and Pavelescu 1982, as in Armstrong-Hélouvry, Dupont and Canudas de "
        "Wit, Automatica 30 (1994) 1083, sec. 2",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        size = Parameter("static_excess_n", "N", 0.2 * scale.force_n, "static beyond Coulomb friction", positive=True)
        speeds = tuple(share * scale.speed_m_s for share in SHARES)
        speed = Parameter("stribeck_speed_m_s", "m/s", 0.1 * scale.speed_m_s, "at which 37 % of it are left", speeds)
        return (
            DriveForm((size, speed), lambda s, shape: (s.direction * np.exp(-np.abs(s.speed_m_s) / shape[0]))[:, None]),
        )
