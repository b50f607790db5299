"""Friction without memory: over direction, place, speed and time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.laws.contract import Parameter, Scale, ScaledSource, SourceForm, Texts
from dbbstation.laws.memory import warmed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats


COULOMB_SHARE = 0.5
"""Usual size, one standard deviation, relative to the force's rms."""


class CoulombFriction(ScaledSource):
    """Friction independent of speed: F = F_c sign(v)."""

    name = "coulomb-friction"
    needs = ("direction",)
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

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = Parameter(
            "coulomb_n", "N", COULOMB_SHARE * scale.force_n, "force against the direction of travel", positive=True
        )
        return (SourceForm((size,), lambda v, _: v["direction"][:, None]),)


class FrictionAsymmetry(ScaledSource):
    """Coulomb friction differs by 2 A between directions, viscous by 2 B.

    F = A + B |v|, added to F_c sign(v) + F_v v, gives (F_c + A) + (F_v + B) v forwards and (F_c - A) + (F_v - B) |v|
    backwards. In motion A acts like a constant load, B does not.
    """

    name = "friction-asymmetry"
    needs = ("direction", "speed_mm_s")
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

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
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
            SourceForm((dry,), lambda v, _: np.abs(v["direction"])[:, None], label="Coulomb"),
            SourceForm((wet,), lambda v, _: 1e-3 * np.abs(v["speed_mm_s"])[:, None], label="viscous"),
        )

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        return abs(values.get("coulomb_asymmetry_n", 0.0)) <= max(values.get("coulomb_n", 0.0), 0.0)


class PositionFriction(ScaledSource):
    """Coulomb friction along the travel: F = sign(v) (p_1 s + p_2 s²), s from -1 to 1."""

    name = "position-friction"
    varies_with = "position by direction"
    needs = ("position_mm", "direction")
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

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = 0.2 * scale.force_n
        slope = Parameter("slope_n", "N", size, "friction at the upper end of the travel less that in the middle")
        bow = Parameter("bow_n", "N", size, "friction at both ends of the travel less that in the middle")
        middle, half = 0.5 * (scale.low_m + scale.high_m), 0.5 * scale.travel_m

        def place(variables: Mapping[str, Floats]) -> Floats:
            return (1e-3 * variables["position_mm"] - middle) / half

        return (
            SourceForm((slope,), lambda v, _: (v["direction"] * place(v))[:, None], label="slope"),
            SourceForm((bow,), lambda v, _: (v["direction"] * place(v) ** 2)[:, None], label="bow"),
        )


STRIBECK_SHARES = (0.02, 0.04, 0.07, 0.1, 0.14, 0.2, 0.28)
"""Tried Stribeck speeds, over the greatest speed; above a fifth the curve is not limited to low speed."""


class StribeckFriction(ScaledSource):
    """Static friction above Coulomb: F = F_s sign(v) exp(-|v| / v_s)."""

    name = "stribeck-friction"
    needs = ("speed_mm_s", "direction")
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

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = Parameter("static_excess_n", "N", 0.2 * scale.force_n, "static beyond Coulomb friction", positive=True)
        speeds = tuple(share * scale.speed_m_s for share in STRIBECK_SHARES)
        speed = Parameter("stribeck_speed_m_s", "m/s", 0.1 * scale.speed_m_s, "at which 37 % of it are left", speeds)
        return (
            SourceForm(
                (size, speed),
                lambda v, k: (v["direction"] * np.exp(-1e-3 * np.abs(v["speed_mm_s"]) / k[speed.name]))[:, None],
            ),
        )


POWERS = (1.5, 2.0, 2.5, 3.0)
"""Tried powers. At few speeds, powers below 1 cannot be distinguished from Coulomb plus viscous friction; unnamed
shapes cover them."""


class PowerLawFriction(ScaledSource):
    """Beyond viscous friction: F = F_p sign(v) (|v| / v_max)^a."""

    name = "power-law-friction"
    needs = ("speed_mm_s", "direction")
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

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = Parameter(
            "at_greatest_speed_n", "N", 0.2 * scale.force_n, "friction at the greatest speed", positive=True
        )
        power = Parameter("power", "1", 1.0, "exponent of the speed", POWERS)
        top = 1e3 * scale.speed_m_s

        return (
            SourceForm(
                (size, power),
                lambda v, k: (v["direction"] * (np.abs(v["speed_mm_s"]) / top) ** k[power.name])[:, None],
            ),
        )


DRIFT_SHARES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 5.0)
"""Tried time constants over the recording's length; the last is almost a straight line."""


class FrictionDrift(ScaledSource):
    """Friction drifts: F = (C sign(v) or V v) g(t), g = 1 - exp(-t / tau) less its mean."""

    name = "friction-drift"
    varies_with = "time by direction"
    needs = ("t_s", "speed_mm_s", "direction")
    form_uncertainty = 0.2  # one time constant represents oil, seals and screw
    texts = Texts(
        what="Friction changes during the recording: lubricant warms and thins, seals and bearings run in.",
        shows="The force at the same place, speed and direction is not the same later on; forwards and backwards it "
        "changes to opposite sides.",
        confirm="Repeat one stroke for half an hour from cold and plot the mean force of each direction over time.",
        cure="Warm the drive before measuring; a lubricant of flatter viscosity; friction feed-forward that follows "
        "temperature.",
        equation="F = C sign(v) g(t) or V v g(t), g = 1 - exp(-t / tau) less its mean",
        origin="Bittencourt and Gunnarsson, Static friction in a robot joint, J. Dyn. Sys. Meas. Control 134 (2012) "
        "051013: Coulomb and viscous friction over temperature",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        dry = Parameter("coulomb_change_n", "N", 0.2 * scale.force_n, "change of Coulomb friction in the end")
        wet = Parameter(
            "viscous_change_n_s_m", "N·s/m", 0.2 * scale.force_n / scale.speed_m_s, "change of viscous friction"
        )
        tau = Parameter(
            "time_constant_s",
            "s",
            0.3 * scale.duration_s,
            "after which 63 % of the change are done",
            tuple(share * scale.duration_s for share in DRIFT_SHARES),
        )
        return (
            SourceForm((dry, tau), lambda v, k: (v["direction"] * _growth(v["t_s"], k[tau.name]))[:, None], "Coulomb"),
            SourceForm(
                (wet, tau), lambda v, k: (1e-3 * v["speed_mm_s"] * _growth(v["t_s"], k[tau.name]))[:, None], "viscous"
            ),
        )


def _growth(time_s: Floats, constant_s: float) -> Floats:
    done = warmed(time_s - time_s[0], constant_s)
    return done / done[-1] - np.mean(done / done[-1])
