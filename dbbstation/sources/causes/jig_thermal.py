"""Thermal growth of the jig plate since the CMM."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import MM_PER_UM_M, Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.temperature import STEEL_UM_M_K

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class JigThermal(LinearSource):
    """Balls move away from the plate's origin: db = a T (b - b_0).

    T is the warming since the CMM, a the jig file's expansion coefficient of plate and holders. Another centre of
    growth only shifts the plate, which defines the coordinates. A ball in no bore stays.
    """

    name = "jig-thermal"
    belongs_to = Owner.SESSION
    form_uncertainty = 0.03  # temperatures of plate and holders agree within a few per cent
    texts = Texts(
        what="The jig plate is warmer or colder on the machine than it was on the coordinate measuring machine: its "
        "balls stand further apart and higher, or closer and lower.",
        shows="Circles at the outer bores are shifted outwards, those on long holders and risers upwards, in proportion; "
        "nothing is deformed. A ball off the tool tip looks almost the same.",
        confirm="Put a thermometer on the plate and compare with the `cmm_temp_c` of the jig file.",
        cure="Leave the plate on the machine table over night and measure in the morning; or scale the CMM sheet to the "
        "plate's temperature.",
        equation="b = CMM centre + a T (CMM centre - origin of the jig)",
        origin="linear expansion, ISO 1: lengths are stated at 20 degC",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (Parameter("warmer_k", "K", 2.0, "temperature of the plate on the machine minus that on the CMM"),)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        setup = motion.setup
        if setup is None or setup.plate is None:
            return Effect(fixed_ball_mm=np.zeros((3, 1)))
        stated = setup.plate.expansion_um_m_k
        # Plate, holders and risers are steel unless the jig file states otherwise.
        per_kelvin = MM_PER_UM_M * (STEEL_UM_M_K if stated is None else stated)
        return Effect(fixed_ball_mm=per_kelvin * (setup.fixed_ball_mm - setup.plate.origin_mm)[:, None])
