"""Play of strut drives under load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import erf

from dbbstation.laws.play import EQUATION, FORM_UNCERTAINTY, PlayState, followed, leaning
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import (
    MM_PER_UM,
    SMOOTH_MM,
    CForm,
    Effect,
    ErrorSource,
    Motion,
    Need,
    Owner,
    Parameter,
    SourceWithHistory,
    Texts,
    of_each_strut,
    of_own_strut,
)
from dbbstation.sources.laws.weights import platform_masses, stated_loads

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

FRICTION_N = (0.0, 25.0, 50.0, 100.0, 200.0, 400.0, 800.0)
"""Tried friction forces, from zero to more than a strut's load in upright circles [N]."""

SHAKING_N = (25.0, 50.0, 100.0, 200.0, 400.0)
"""Tried shaking forces, from a twentieth of a strut's load to the whole load [N]."""


class Play(SourceWithHistory):
    """The load holds a strut at one end of its play; only friction above the load makes it lag.

    The play is w, the tension T, the friction behind the play R. For T > R the strut is longer by w/2, for T < -R
    shorter by w/2, and reversals have no effect. For |T| < R the law is `backlash`. Tensions are nominal at commanded
    poses, with the machine file's weights.

    A run begins in motion. Negative w inverts the effect. The friction is searched on a grid, because it changes the
    error only at single samples.
    """

    name = "play"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    needs = frozenset({Need.POSE, Need.PATH})
    varies_with = "strut-force"
    form_uncertainty = FORM_UNCERTAINTY
    texts = Texts(
        what="Nut, bearing or joint of a strut has play that the platform's weight keeps closed. Where the force in the "
        "strut changes from pull to push, the strut gives way by the play.",
        shows="Steps in circles with the spindle tilted, where the force in one strut changes its sign: at the same "
        "places clockwise and counter-clockwise. With friction a step comes sooner, as soon as the force is small enough "
        "to be held. Circles in which no force comes near zero show nothing, at reversals neither.",
        confirm="Stand still, hang a weight on the spindle so that the strut's force changes its sign, and watch the "
        "strut with a dial gauge: it jumps by the play.",
        cure="Preload or exchange the part; until then balance the platform so that the struts' forces keep their sign "
        "in the work.",
        equation=f"actual minus driven length = +w/2 where T > R, -w/2 where T < -R; between, y_k - x_k with {EQUATION}; "
        "or, where drives shake the strut with a force N, w/2 erf(T / (sqrt(2) N))",
        origin="play closed by the load, held by Coulomb's friction; T from the platform's equilibrium "
        "[GRAV eq 1, 6], whose signs turn in 12 of the 15 circles of [CAL Table II] on the reference machine; shaken: a relay with "
        "Gaussian dither (Gelb and Vander Velde, Multiple-Input Describing Functions, 1968)",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        platform_masses(self.name, machine)
        plays = of_each_strut("strut_{}_um", "µm", 3.0, "play of strut {}, whole width; positive: load closes it")
        meaning = "force in a strut below which friction holds it, all struts alike"
        return (*plays, Parameter("friction_n", "N", 100.0, meaning, FRICTION_N))

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> PlayState:  # noqa: ARG002
        self.require(motion)
        return leaning(motion.struts(machine).length_mm)

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: PlayState) -> tuple[Effect, PlayState]:
        place, _, behind = self._places(motion, machine, values, state)
        return Effect(strut_mm=place), behind

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        _, by_width, _ = self._places(motion, machine, values, self.begin(motion, machine, values))
        by_play = of_own_strut(MM_PER_UM * by_width)
        return Effect(strut_mm=np.concatenate([by_play, np.zeros((*by_width.shape, 1))], axis=2))

    def _places(
        self, motion: Motion, machine: Machine, values: Floats, state: PlayState
    ) -> tuple[Floats, Floats, PlayState]:
        tension, width = _tensions(motion, machine), MM_PER_UM * values[:STRUTS]
        friction = max(float(values[STRUTS]), 0.0)
        place, by_width, behind = followed(motion.struts(machine).length_mm, np.abs(width), state, tension, friction)
        return np.where(width < 0.0, -place, place), by_width, behind


class _Shaken(ErrorSource, law="shaken", law_of=Play, extends=Play):
    """The drive shakes the strut, which crosses its play gradually while the load changes from pull to push.

    The strut's force is T plus Gaussian shaking of standard deviation N. Its sign gives the end of the play, so the
    mean extension is w/2 erf(T / (sqrt(2) N)).
    """

    needs = frozenset({Need.POSE})

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        plays = Play().parameters(machine)[:STRUTS]
        meaning = "standard deviation of the force that shakes a strut across its play, all struts alike"
        return (*plays, Parameter("shaking_n", "N", 100.0, meaning, SHAKING_N))

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        share = erf(_tensions(motion, machine) / _spread_n(values))
        return Effect(strut_mm=0.5 * MM_PER_UM * values[:STRUTS] * share)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        ratio = _tensions(motion, machine) / _spread_n(values)
        by_play = of_own_strut(0.5 * MM_PER_UM * erf(ratio))
        steep = -np.sqrt(2.0) / _spread_n(values) * 2.0 / np.sqrt(np.pi) * ratio * np.exp(-np.square(ratio))
        by_force = 0.5 * MM_PER_UM * values[:STRUTS] * steep
        return Effect(strut_mm=np.concatenate([by_play, by_force[:, :, None]], axis=2))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        return CForm(
            """double load[6] = {0.0}, pull[6][3], t[6], moving = GRAVITY * (STRUT_KG[3] + STRUT_KG[0] / 2.0);
platform_load(at, load);
strut_load(at, STRUT_KG, load, pull);
tensions(at, load, t);
EACH e->strut[i] += 0.5e-3 * v[i] * erf((t[i] - moving * at->unit[i][2]) / spread);""",
            constants={"spread": _spread_n(values)},
        )


LEAST_N = 1.0
"""Least shaking force; below it the play is crossed abruptly [N]."""


def _spread_n(values: Floats) -> float:
    return float(np.sqrt(2.0) * max(values[STRUTS], LEAST_N))


def _tensions(motion: Motion, machine: Machine) -> Floats:
    """Return the drives' loads, positive if they pull, shape (n, 6) [N]."""
    return stated_loads(Play.name, machine, motion.frames(machine), motion.struts(machine))
