"""Friction that differs by direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts

if TYPE_CHECKING:
    from collections.abc import Mapping


class FrictionAsymmetry(DriveSource):
    """Coulomb friction differs by 2 A between directions, viscous by 2 B.

    F = A + B |v|, added to F_c sign(v) + F_v v, gives (F_c + A) + (F_v + B) v forwards and (F_c - A) + (F_v - B) |v|
    backwards. In motion A acts like a constant load, B does not.
    """

    name = "friction-asymmetry"
    varies_with = "speed"
    form_uncertainty = 0.05  # as Coulomb friction
    texts = Texts(
        what="Friction is greater in one direction of travel than in the other, in its Coulomb part, its viscous part "
        "or both.",
        shows="At equal speeds forwards and backwards the forces differ in size; where the viscous part differs, the "
        "more so the faster it goes.",
        confirm="Travel to and fro at several constant speeds, then turn the drive round on its mounting, or balance "
        "its load: what turns with the drive is its friction, what stays is a load.",
        cure="Look at what works on one side only: nut preload, axial bearing, wiper seals, a misaligned guide; give "
        "the control a friction feed-forward per direction.",
        equation="F = A + B |v|",
        origin="Armstrong-Hélouvry, Control of Machines with Friction (1991), ch. 4; offset by asymmetrical Coulomb "
        "friction in Janot, Gautier and Brunot, EMPS benchmark (2019)",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        if not scale.both_ways:
            return ()
        dry = Parameter("coulomb_asymmetry_n", "N", 0.2 * scale.force_n, "half of forwards minus backwards")
        wet = Parameter(
            "viscous_asymmetry_n_s_m",
            "N·s/m",
            0.2 * scale.force_n / scale.speed_m_s,
            "half of forwards minus backwards",
        )
        return (
            DriveForm((dry,), lambda s, _: np.abs(s.direction)[:, None], label="Coulomb"),
            DriveForm((wet,), lambda s, _: np.abs(s.speed_m_s)[:, None], label="viscous"),
        )

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        return abs(values.get("coulomb_asymmetry_n", 0.0)) <= max(values.get("coulomb_n", 0.0), 0.0)
