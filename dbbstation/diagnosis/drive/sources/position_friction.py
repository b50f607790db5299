"""Friction that depends on position."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.signals import Signals


class PositionFriction(DriveSource):
    """Coulomb friction along the travel: F = sign(v) (p_1 s + p_2 s²), s from -1 to 1."""

    name = "position-friction"
    varies_with = "position by direction"
    form_uncertainty = 0.2  # wear and bent guides are no exact parabolas
    texts = Texts(
        what="Friction changes along the travel: the screw's pitch diameter, the alignment of the guide or the "
        "tension of a cover is not the same everywhere.",
        shows="The gap between the forces forwards and backwards opens or closes along the travel.",
        confirm="Travel slowly at constant speed over the whole stroke and back; plot half the difference of the "
        "forces over position.",
        cure="Align screw and guide; check the screw for wear where it is used most.",
        equation="F = sign(v) (p_1 s + p_2 s²), s = -1 ... 1 over the travel",
        origin="Armstrong-Hélouvry, Control of Machines with Friction (1991), ch. 4: position-dependent friction",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        size = 0.2 * scale.force_n
        slope = Parameter("slope_n", "N", size, "friction at the upper end of the travel less that in the middle")
        bow = Parameter("bow_n", "N", size, "friction at both ends of the travel less that in the middle")
        middle, half = 0.5 * (scale.low_m + scale.high_m), 0.5 * scale.travel_m

        def place(signals: Signals) -> Floats:
            return (signals.position_m - middle) / half

        return (
            DriveForm((slope,), lambda s, _: (s.direction * place(s))[:, None], label="slope"),
            DriveForm((bow,), lambda s, _: (s.direction * place(s) ** 2)[:, None], label="bow"),
        )
