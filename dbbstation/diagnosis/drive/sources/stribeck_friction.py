"""Cause: friction that falls with growing speed near standstill."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveSource, Form, Parameter, Texts

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.signals import Signals

SHARES = (0.02, 0.05, 0.1, 0.2)
"""Stribeck speeds that are tried, of the greatest speed: above a fifth the curve is no longer one of low speed."""


class StribeckFriction(DriveSource):
    """Static friction above Coulomb friction that decays with speed: F = F_s sign(v) exp(-|v| / v_s)."""

    name = "stribeck-friction"
    varies_with = "speed"
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

    def forms(self, signals: Signals, residual_n: NDArray[np.float64]) -> tuple[Form, ...]:  # noqa: ARG002
        """One amplitude at several Stribeck speeds."""
        scale = signals.scale
        size = Parameter("static_excess_n", "N", 0.2 * scale.force_n, "static beyond Coulomb friction")
        speed = Parameter("stribeck_speed_m_s", "m/s", 0.1 * scale.speed_m_s, "at which 37 % of it are left")
        return tuple(Form((size,), _columns, speed, share * scale.speed_m_s, 1.6) for share in SHARES)

    def possible(self, values: Mapping[str, float]) -> bool:
        """Static friction is above Coulomb friction, or it is another curve."""
        return values["static_excess_n"] > 0.0


def _columns(signals: Signals, speed_m_s: float) -> NDArray[np.float64]:
    return (signals.direction * np.exp(-np.abs(signals.speed_m_s) / speed_m_s))[:, None]
