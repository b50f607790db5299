"""Friction that changes as the drive warms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.signals import Signals

SHARES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 5.0)
"""Tried time constants over the recording's length; the last is almost a straight line."""


class FrictionDrift(DriveSource):
    """Friction drifts: F = (C sign(v) or V v) g(t), g = 1 - exp(-t / tau) less its mean."""

    name = "friction-drift"
    varies_with = "time by direction"
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

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        dry = Parameter("coulomb_change_n", "N", 0.2 * scale.force_n, "change of Coulomb friction in the end")
        wet = Parameter(
            "viscous_change_n_s_m", "N·s/m", 0.2 * scale.force_n / scale.speed_m_s, "change of viscous friction"
        )
        tau = Parameter(
            "time_constant_s",
            "s",
            0.3 * scale.duration_s,
            "after which 63 % of the change are done",
            tuple(share * scale.duration_s for share in SHARES),
        )
        return (
            DriveForm((dry, tau), lambda s, t: (s.direction * _growth(s, t[0]))[:, None], "Coulomb"),
            DriveForm((wet, tau), lambda s, t: (s.speed_m_s * _growth(s, t[0]))[:, None], "viscous"),
        )


def _growth(signals: Signals, time_constant_s: float) -> Floats:
    since = signals.t_s - signals.t_s[0]
    done = -np.expm1(-since / time_constant_s)
    return done / done[-1] - np.mean(done / done[-1])
