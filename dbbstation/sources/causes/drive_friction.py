"""Relation of a strut's load to its motor's current."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.laws.play import resistance
from dbbstation.machine.geometry import STRUT_NUMBERS, STRUTS
from dbbstation.sources.contract import SMOOTH_MM, Effect, ErrorSource, Motion, Need, Owner, Parameter, Texts
from dbbstation.sources.laws.motion import driven_in_time, speed_mm_s
from dbbstation.sources.laws.weights import platform_masses, stated_loads

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

N_PER_KN = 1e3

TURNED_OVER_MM = 0.05
"""Travel after a reversal until friction has reversed. Rolling contacts and seals are elastic before they slide and
need some micrometres, belts and couplings some tens [Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30
(1994) 1083, sec. 2.2, and the wind-up of the drive on top]."""

PER_MOTOR = ("gain_a_kn", "coulomb_n", "viscous_ns_mm", "load_share_n_kn", "asymmetry_n")
"""Kinds of a motor's parameters, in order."""


def of_motor(motor: int, kind: str) -> str:
    """Return a motor's parameter name; motors count from 1 to 6, `kind` is one of `PER_MOTOR`."""
    return f"motor_{motor}_{kind}"


MOTOR_OF_GAIN = {of_motor(motor, PER_MOTOR[0]): motor for motor in STRUT_NUMBERS}
"""Motors, 1 to 6, by the name of their gain."""


class DriveFriction(ErrorSource):
    """A motor's current balances load and drive friction.

    I = k (F - s (F_c + e |F|) - b v - a). The load F is positive if the platform pulls, speed v and direction s if the
    strut grows. The screw's loss e is 1 / efficiency - 1 against the load and 1 - efficiency with it. The offset a is
    half the asymmetry of Coulomb friction, or a zero offset of the current.

    The load follows from stated weights and the centre of gravity at the actual pose. Currents determine only gain
    times weight, so the stated weight is assumed. After a reversal friction changes sign linearly over TURNED_OVER_MM;
    readings there are unusable. Bars and poses do not depend on this source.
    """

    name = "drive-friction"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    needs = frozenset({Need.POSE, Need.PATH, Need.TIME, Need.CURRENT})
    looks_ahead = True  # speeds are differences to the previous and next row
    varies_with = "strut-speed-sign"
    form_uncertainty = 0.2  # friction differs along the screw and with temperature
    texts = Texts(
        what="Between the load of a strut and the current of its motor lie the gain of the drive and friction: a constant "
        "part, one that grows with the speed and one that grows with the load.",
        shows="In the motor currents only: at one place of a circle the current of a strut is lower while it grows than "
        "while it shrinks. Half the sum of both directions is the load, half the difference the friction.",
        confirm="Move one strut up and down slowly at one place and read the current both ways, then at twice the speed.",
        cure="None needed: it is what stands between currents and the weights that they tell of. Friction that is larger "
        "in one drive, or grows from month to month, is a screw, nut or bearing that wears or lacks grease.",
        equation="I = k (F - s (F_c + e |F|) - b v - a), s and v positive where the strut grows",
        origin="[GRAV 3.2] with friction, which the paper does not mention; Coulomb, viscous and load friction as in "
        "Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        platform_masses(self.name, machine)
        found = []
        for motor in STRUT_NUMBERS:
            kinds = (
                ("A/kN", 2.5, f"current of motor {motor} per force that pulls its strut"),
                ("N", 100.0, f"constant friction of drive {motor}, positive: against the motion"),
                ("Ns/mm", 2.0, f"friction of drive {motor} per speed, positive: against the motion"),
                ("N/kN", 50.0, f"friction of drive {motor} per load, positive: against the motion"),
                (
                    "N",
                    50.0,
                    f"friction of drive {motor} growing less that shrinking, half of it, or zero of the current",
                ),
            )
            found += [Parameter(of_motor(motor, name), *kind) for name, kind in zip(PER_MOTOR, kinds, strict=True)]
        return tuple(found)

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        carried, _ = _carried(self._driven(motion, machine), values)
        return Effect(current_a=_by_motor(values)[0] / N_PER_KN * carried)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        carried, frictions = _carried(self._driven(motion, machine), values)
        gain = _by_motor(values)[0][:, None] / N_PER_KN
        answers = np.concatenate([carried[:, :, None] / N_PER_KN, -gain * frictions], axis=2)
        by_parameter = np.zeros((len(answers), STRUTS, STRUTS, len(PER_MOTOR)))
        own = np.arange(STRUTS)
        by_parameter[:, own, own] = answers
        return Effect(current_a=by_parameter.reshape(len(answers), STRUTS, -1))

    def current_per_load(self, motion: Motion, machine: Machine, values: Floats) -> Floats:
        gain, share = _by_motor(values)[[0, 3]] / N_PER_KN
        load, direction, _ = self._driven(motion, machine)
        answer: Floats = gain * (1.0 - share * direction * np.sign(load))
        return answer

    def _driven(self, motion: Motion, machine: Machine) -> tuple[Floats, Floats, Floats]:
        if motion.time_s is None:
            self.require(motion)
        time_s, length, place = driven_in_time(motion, machine)
        load = motion.load_n
        if load is None:
            load = stated_loads(self.name, machine, motion.frames(machine), motion.struts(machine))
        return load, -resistance(length, TURNED_OVER_MM)[0][place], speed_mm_s(time_s, length)[place]


def driven_directions(motion: Motion, machine: Machine) -> Floats:
    """Return the direction of friction along a motion, -1 (shrinking) to 1 (growing), shape (n, 6).

    Readings with values between -1 and 1, within TURNED_OVER_MM of a reversal, cannot be used.
    """
    return -resistance(motion.struts(machine).length_mm, TURNED_OVER_MM)[0]


def _by_motor(values: Floats) -> Floats:
    return values.reshape(STRUTS, len(PER_MOTOR)).T


def _carried(driven: tuple[Floats, Floats, Floats], values: Floats) -> tuple[Floats, Floats]:
    load, direction, speed = driven
    frictions = np.stack([direction, speed, direction * np.abs(load) / N_PER_KN, np.ones_like(load)], axis=-1)
    return load - np.einsum("nik,ki->ni", frictions, _by_motor(values)[1:]), frictions
